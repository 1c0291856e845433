"""`python -m evimo.cli`, the same as `evimo`."""

import sys

from evimo.cli import main

if __name__ == "__main__":
    sys.exit(main())
