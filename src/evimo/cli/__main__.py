"""`python -m evimo.cli`, the same as `evimo`."""

import sys

from evimo.cli import main

sys.exit(main())
