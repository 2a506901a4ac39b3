"""`python -m live`."""

import sys

from tagtrack.live.cli import main

if __name__ == "__main__":
    sys.exit(main())
