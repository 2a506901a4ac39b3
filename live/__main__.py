"""`tagtrack live`."""

import sys

try:
    from tagtrack.live.cli import main
except ImportError as missing:  # a package, or numba's leave to compile
    print(f"error: {missing}", file=sys.stderr)
    sys.exit(2)

if __name__ == "__main__":
    sys.exit(main())
