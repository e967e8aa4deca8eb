# PYTHON_ARGCOMPLETE_OK
"""The program: `python -m irtscots_cl` is the command `irtscots`."""

import os
import sys


def main() -> int:
    """Run the command line of this process; Ctrl-C and SIGTERM are handled from here to the process's end."""
    from irtscots_cl.system import interruption

    interruption.handle()
    # OpenBLAS reads it when NumPy is imported. Its threads otherwise spin for some 30 ms after each product.
    os.environ.setdefault("OPENBLAS_THREAD_TIMEOUT", "4")  # 2^4 cycles, the least: then they sleep
    from irtscots_cl.cli import main  # after it: this import takes most of the time before a command begins

    return main()


if __name__ == "__main__":
    sys.exit(main())
