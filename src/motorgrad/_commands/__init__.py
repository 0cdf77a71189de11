"""The commands of `motorgrad`, one module each with a function `run(arguments) -> exit status`."""
