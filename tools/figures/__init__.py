"""The documentation's figures, drawn by the library itself: `python -m tools.figures`."""
