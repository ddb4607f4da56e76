"""Ctrl-C and termination that wait for places where stopping is safe.

Python turns them into exceptions between any two instructions: while files are renamed, that leaves half of them; while
the solvers load, it ends the process from within them.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager


@contextmanager
def interruptions_wait() -> Iterator[Callable[[], None]]:
    """Let Ctrl-C and termination wait for the end of the block, where they act as they would have.

    Yields a function to be called where stopping is safe: it raises KeyboardInterrupt when one of them came.
    """
    came: list[int] = []

    def stop_here() -> None:
        if came:
            raise KeyboardInterrupt

    def deliver() -> None:
        if came:
            signal.raise_signal(came[0])

    with ExitStack() as stack:
        if threading.current_thread() is threading.main_thread():  # in others nothing interrupts
            stack.callback(deliver)
            for number in (signal.SIGINT, signal.SIGTERM):
                handler = signal.getsignal(number)
                if handler not in (signal.SIG_IGN, None):
                    stack.callback(signal.signal, number, handler)
                    signal.signal(number, lambda number, frame: came.append(number))
        yield stop_here
