"""Deferral of Ctrl-C and termination to points where stopping is safe.

Python raises them between any two instructions: during the renaming of files only some would be renamed; during the
import of solvers the process would abort.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager


@contextmanager
def interruptions_wait() -> Iterator[Callable[[], None]]:
    """Defer Ctrl-C and termination to the end of the block.

    Yields a function to call where stopping is safe; it raises KeyboardInterrupt if one of them is pending.
    """
    came: list[int] = []

    def stop_here() -> None:
        if came:
            raise KeyboardInterrupt

    def deliver() -> None:
        if came:
            signal.raise_signal(came[0])

    with ExitStack() as stack:
        if threading.current_thread() is threading.main_thread():  # other threads receive no signals
            stack.callback(deliver)
            for number in (signal.SIGINT, signal.SIGTERM):
                handler = signal.getsignal(number)
                if handler not in (signal.SIG_IGN, None):
                    stack.callback(signal.signal, number, handler)
                    signal.signal(number, lambda number, frame: came.append(number))
        yield stop_here
