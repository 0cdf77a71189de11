"""The speed table: measured and stored row by row, drawn, and compared between commits."""

import os

ENVIRONMENT = dict(os.environ)
"""The variables as this command was given them. Importing motorgrad sets some, such as options of the compiler, and
what one commit sets must not reach the processes of another."""
