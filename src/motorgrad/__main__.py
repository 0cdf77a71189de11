"""`python -m motorgrad` is the same as `motorgrad`."""

import sys

from motorgrad.cli import main

sys.exit(main())
