"""Whole runs by HiGHS, in silence: the mixed-integer program of the choice of runs.

HiGHS tells of repaired solutions on standard output even where it is told to be silent. Results in JSON go there, too,
so the file descriptor leads nowhere meanwhile.

Source: Q. Huangfu and J. A. J. Hall, Parallelizing the dual revised simplex method, Math. Program. Comput. 10 (2018),
119-142.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from scipy.optimize import Bounds, LinearConstraint, milp

from expdesign.shortest_day.tuning import TUNING
from expdesign.values import Array

STANDARD_OUTPUT = 1


def cheapest_whole(cost_s: Array, A: Array, b: Array, bounds: tuple[Array, Array], whole: int) -> Array | None:
    """(n,) least cost_s @ x with A x >= b within bounds, the first `whole` values of x being whole; None without one.

    Args:
        cost_s: (n,).
        A, b: (c, n) and (c,).
        bounds: (n,) least and most.
        whole: number of values.
    """
    with silent_libraries():
        found = milp(
            cost_s,
            constraints=LinearConstraint(A, lb=b),
            bounds=Bounds(*bounds),
            integrality=np.arange(len(cost_s)) < whole,
            options={"mip_rel_gap": TUNING.choice_gap, "node_limit": TUNING.choice_nodes, "presolve": False},
        )
    return None if found.x is None else np.asarray(found.x)


@contextmanager
def silent_libraries() -> Iterator[None]:
    """What compiled libraries write on standard output in this block goes nowhere."""
    libc = ctypes.CDLL(None if os.name == "posix" else "ucrtbase")

    def flush() -> None:
        if sys.stdout is not None:
            sys.stdout.flush()
        libc.fflush(None)

    flush()
    try:
        kept = os.dup(STANDARD_OUTPUT)
    except OSError:  # it is closed: nothing is heard anyway
        yield
        return
    try:
        with Path(os.devnull).open("wb") as nowhere:
            os.dup2(nowhere.fileno(), STANDARD_OUTPUT)
            yield
    finally:
        flush()
        os.dup2(kept, STANDARD_OUTPUT)
        os.close(kept)
