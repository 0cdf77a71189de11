"""The command `motorgrad sim`."""
