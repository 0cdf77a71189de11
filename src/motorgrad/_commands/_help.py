"""Help for options, from the class's docstring: a text is written once."""

import inspect
import re

FIELD = re.compile(r"^- `(\w+)`([^`:]*): (.*?)(?=\n- |\n\n|\Z)", re.DOTALL | re.MULTILINE)
WORD = re.compile(r"[a-z]+(?=[\s,:;-]|$)")  # not a symbol or a name, such as ρ, k_SE and motorgrad.make


def description_of(cls: type) -> str:
    """What a docstring says before its list of arguments."""
    return _doc(cls).partition("**Arguments")[0].replace("`", "").strip()


def descriptions(cls: type) -> dict[str, str]:
    """What the docstrings of `cls` and of its bases say of each field.

    It stands in lines "- `name` (unit): text" or "- `name` of what: text".
    """
    found: dict[str, str] = {}
    for base in cls.__mro__:
        for name, more, text in FIELD.findall(_doc(base)):
            unit = more if more.startswith(" (") else ""
            said = " ".join(f"{'' if unit or not more else f'{more}: '}{text}".replace("`", "").split())
            said = said[:1].upper() + said[1:] if WORD.match(said) else said
            found.setdefault(name, f"{said.rstrip('.')}{unit}.")
    return found


def _doc(cls: type) -> str:
    return inspect.cleandoc(cls.__dict__.get("__doc__") or "")
