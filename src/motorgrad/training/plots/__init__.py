"""Learning curves as figures, and as TensorBoard event files."""
