"""The command line: arguments -> workflow -> folder of results -> exit status.

Results and summaries go to stdout; progress, messages and errors to stderr. Whatever goes wrong is one line.
"""

from expdesign.cli.entry import main

__all__ = ["main"]
