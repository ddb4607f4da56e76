"""The command line: arguments -> workflow -> folder of results -> exit status.

Results and summaries go to stdout; progress, messages and errors to stderr. Whatever goes wrong is one line.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from expdesign.interruptions import interruptions_wait


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; arguments and exit status as of `expdesign.cli.entry.main`."""
    try:
        with interruptions_wait():
            from expdesign.cli.entry import main as run_command
    except KeyboardInterrupt:
        sys.stderr.write("expdesign: error: interrupted, nothing half-written\n")
        return 130
    return run_command(argv)
