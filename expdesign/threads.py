"""Linear algebra on one thread.

Sums that are shared among threads differ in their last digits with the number of threads, so results would depend on
the machine. Independent work is shared among processes instead, whose threads would only compete for the cores.
"""

from __future__ import annotations

import ctypes
import os
import sys
from pathlib import Path

VARIABLES = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
"""Environment variables that libraries read once they are loaded; where they are set already, that holds."""
SETTERS = tuple(f"{prefix}openblas_set_num_threads{suffix}" for prefix in ("scipy_", "") for suffix in ("64_", ""))
MAPS = Path("/proc/self/maps")  # lists the libraries that this process has loaded, on Linux


def use_one_thread() -> None:
    """Limit linear algebra to one thread: in this process, those that it starts, and libraries loaded already."""
    for name in VARIABLES:
        os.environ.setdefault(name, "1")
    if "numpy" in sys.modules and MAPS.exists():
        threads = os.environ[VARIABLES[0]]
        for library in _loaded() if threads.isdecimal() else ():
            for name in SETTERS:
                if hasattr(library, name):
                    getattr(library, name)(int(threads))


def _loaded() -> list[ctypes.CDLL]:
    """OpenBLAS, as NumPy and SciPy bring it."""
    paths = {line.split(maxsplit=5)[-1] for line in MAPS.read_text().splitlines() if "openblas" in line}
    return [ctypes.CDLL(path) for path in sorted(paths)]
