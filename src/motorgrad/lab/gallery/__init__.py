"""Ready diagrams."""
