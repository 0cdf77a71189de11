"""`python -m motorgrad` is the same as `motorgrad`."""

from motorgrad.cli import run

run()
