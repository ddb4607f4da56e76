"""Linear algebra uses one thread, whether NumPy is loaded before or after: more threads round sums differently."""

import os
import subprocess
import sys

import pytest

from expdesign.threads import MAPS, SETTERS, VARIABLES

COUNT = f"""
from expdesign.threads import _loaded
names = {[name.replace("set", "get") for name in SETTERS]}
print(*[getattr(library, name)() for library in _loaded() for name in names if hasattr(library, name)])
"""


@pytest.mark.skipif(not MAPS.exists(), reason="nothing lists the libraries of a process here")
@pytest.mark.parametrize("order", ["import numpy, expdesign, scipy.linalg", "import expdesign, numpy, scipy.linalg"])
@pytest.mark.parametrize(("stated", "expected"), [(None, 1), ("2", min(2, os.cpu_count() or 1))])
def test_every_library_of_linear_algebra_uses_the_threads_that_are_stated_or_one(order, stated, expected):
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    if stated is not None:
        environment |= {VARIABLES[0]: stated}
    command = [sys.executable, "-c", order + COUNT]
    counts = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout.split()
    assert counts
    assert {int(count) for count in counts} == {expected}
