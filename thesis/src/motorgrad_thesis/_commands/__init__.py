"""The commands `motorgrad reproduce` and `motorgrad demo`."""
