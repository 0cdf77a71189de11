"""How figures look."""

from typing import Any

FLEXOR, EXTENSOR = "#3b6fb6", "#c8452f"
"""Colours of the two kinds of muscle."""

STYLE: dict[Any, Any] = {
    "font.size": 10,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.fonttype": "path",  # formulas look the same where the fonts are missing
    "svg.hashsalt": "motorgrad",  # the same figure, the same bytes
    "figure.dpi": 100,
}
