"""Bodies from MJCF: anyone's models, and their parts by name."""
