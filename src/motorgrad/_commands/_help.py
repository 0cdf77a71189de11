"""Help for options, from the class's docstring: a text is written once."""

import re

from motorgrad._docstrings import docstring_of, field_texts

WORD = re.compile(r"[a-z]+(?=[\s,:;-]|$)")  # not a symbol or a name, such as ρ, k_SE and motorgrad.make


def description_of(cls: type) -> str:
    """What a docstring says before its list of arguments."""
    return docstring_of(cls).partition("**Arguments")[0].replace("`", "").strip()


def descriptions(cls: type) -> dict[str, str]:
    """What the docstrings of `cls` and of its bases say of each field, as sentences."""
    found: dict[str, str] = {}
    for name, (more, text) in field_texts(cls).items():
        unit = more if more.startswith(" (") else ""
        said = " ".join(f"{'' if unit or not more else f'{more}: '}{text}".replace("`", "").split())
        said = said[:1].upper() + said[1:] if WORD.match(said) else said
        found[name] = f"{said.rstrip('.')}{unit}."
    return found
