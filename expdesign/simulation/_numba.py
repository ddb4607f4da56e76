"""Compiled loops for many runs at once; numba is optional (``pip install expdesign[fast]``).

Random numbers are NumPy's to the last bit; sines and cosines are the C library's, so motions agree to rounding.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

from expdesign.errors import InputError

OPERATIONS = ("add", "subtract", "multiply", "negative", "absolute", "sin", "cos", "positive")
"""NumPy's names; the place of each is its code."""
BINARY = (0, 1, 2)


@cache
def kernels() -> tuple[Callable[[Any, Any], Callable[[], None]], Callable[[Any, Any, Any, Any], None]]:
    """Compile, once.

    Returns:
        (codes, memory) -> a function that does all operations on the rows of memory once; and one of (generator,
        spread (8,), sea (k, 4, n), noise (k, 8, n)) that fills the sea with standard normal numbers and the noise with
        spread times such, sample by sample, in NumPy's order.

    Raises:
        InputError: numba is not installed.
    """
    try:
        from numba import njit
    except ImportError:
        raise InputError("engine 'numba' needs numba, which is not installed: pip install 'expdesign[fast]'") from None
    execute, normal = njit(nogil=True)(_execute), njit(nogil=True)(_normal)
    return lambda codes, memory: lambda: execute(codes, memory), normal


def _execute(codes: Any, memory: Any) -> None:
    for code, a, b, out in codes:
        x, y, z = memory[a], memory[b], memory[out]
        if code == 0:
            for i in range(len(z)):
                z[i] = x[i] + y[i]
        elif code == 1:
            for i in range(len(z)):
                z[i] = x[i] - y[i]
        elif code == 2:
            for i in range(len(z)):
                z[i] = x[i] * y[i]
        elif code == 3:
            for i in range(len(z)):
                z[i] = -x[i]
        elif code == 4:
            for i in range(len(z)):
                z[i] = abs(x[i])
        elif code == 5:
            for i in range(len(z)):
                z[i] = math.sin(x[i])
        elif code == 6:
            for i in range(len(z)):
                z[i] = math.cos(x[i])
        else:
            for i in range(len(z)):
                z[i] = x[i]


def _normal(rng: Any, spread: Any, sea: Any, noise: Any) -> None:
    count, rows, runs = noise.shape
    for k in range(count):
        for row in range(sea.shape[1]):
            for i in range(runs):
                sea[k, row, i] = rng.standard_normal()
        for row in range(rows):
            for i in range(runs):
                noise[k, row, i] = spread[row] * rng.standard_normal()
