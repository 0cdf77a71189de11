"""Where claims come from, if not from the thesis."""

OURS = "our own expectation"
INDEPENDENT = "an independent model of the hexapod"
