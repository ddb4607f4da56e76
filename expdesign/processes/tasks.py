"""A task in another process: a function and its arguments, pickled."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import cloudpickle


def done(both: bytes, task: bytes) -> Any:
    """The result of a task, from a function with its shared arguments and from the task's own, all pickled."""
    function, shared = _unpacked(both)
    return function(*shared, *cloudpickle.loads(task))


@lru_cache(maxsize=2)
def _unpacked(both: bytes) -> Any:
    return cloudpickle.loads(both)
