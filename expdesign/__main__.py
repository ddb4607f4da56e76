"""`python -m expdesign` is the console script."""

import sys

from expdesign.cli import main

if __name__ == "__main__":
    sys.exit(main())
