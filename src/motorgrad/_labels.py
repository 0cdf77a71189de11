"""Names in figures, which may be anything, and their units."""

import unicodedata


def with_unit(name: str, unit: str) -> str:
    """A quantity's name with its unit in brackets, where it has one and that is not the `1` of a pure number."""
    return name if unit in ("", "1") else f"{name} ({unit})"


def drawable(name: str) -> str:
    """A name with codes in place of characters that are neither drawn nor allowed in an SVG file."""
    bad = {c for c in name if c != "\n" and unicodedata.category(c) in ("Cc", "Cs", "Cn")}
    return "".join(ascii(c)[1:-1] if c in bad else c for c in name)


def literal(name: str) -> str:
    """A name as matplotlib draws it as it is: what stands between two `$` would be a formula, and what begins with `_`
    would not be in the legend."""
    return f"{' ' * name.startswith('_')}{drawable(name)}".replace("$", r"\$")
