"""The run directory: configuration, provenance, metrics and checkpoints, safe against being killed at any instant."""
