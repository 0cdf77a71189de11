"""Where the built front end is: in a wheel always, in a checkout once it was built."""

from pathlib import Path

STATIC = Path(__file__).parent / "static"
