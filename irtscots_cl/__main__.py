"""`python -m irtscots_cl` is the command `irtscots`."""

import sys

from irtscots_cl.cli import main

if __name__ == "__main__":
    sys.exit(main())
