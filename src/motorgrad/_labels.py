"""Names in figures, which may be anything."""


def literal(name: str) -> str:
    """A name as matplotlib draws it as it is: what stands between two `$` would be a formula, and what begins with `_`
    would not be in the legend."""
    return f"{' ' * name.startswith('_')}{name}".replace("$", r"\$")
