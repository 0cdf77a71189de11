"""The commands of `motorgrad`, one module each with a function `run(arguments) -> exit status`."""

IMPORTED: list[str] = []
"""The modules that `--import` named, which other processes of a command import, too."""
