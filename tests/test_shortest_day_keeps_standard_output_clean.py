"""What the solver of whole runs prints does not reach standard output, where results in JSON are written."""

import subprocess
import sys

PRINTING = """
import ctypes
from expdesign.shortest_day._highs import silent_libraries
libc = ctypes.CDLL(None)
print("before")
libc.puts(b"early")
with silent_libraries():
    libc.puts(b"of the library")
libc.puts(b"late")
libc.fflush(None)
print("after")
"""


def test_libraries_are_silent_in_the_block_and_heard_around_it():
    told = subprocess.run([sys.executable, "-c", PRINTING], capture_output=True, text=True, check=True).stdout
    assert set(told.split("\n")) == {"before", "early", "late", "after", ""}
