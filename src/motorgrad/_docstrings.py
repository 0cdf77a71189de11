"""What class docstrings say of each field: a text is written once, and read by the command line and TimLab."""

import inspect
import re

FIELD = re.compile(r"^- `(\w+)`([^`:]*): (.*?)(?=\n- |\n\n|\Z)", re.DOTALL | re.MULTILINE)


def docstring_of(cls: type) -> str:
    """A class's own docstring without its indentation; bases are not asked."""
    return inspect.cleandoc(cls.__dict__.get("__doc__") or "")


def summary_of(cls: type) -> str:
    """What a class's docstring says before its list of arguments or errors."""
    return re.split(r"\*\*(?:Arguments|Raises)", docstring_of(cls))[0].strip()


def field_texts(cls: type) -> dict[str, tuple[str, str]]:
    """What the docstrings of a class and of its bases say of each field: what follows the name, and the text.

    A field's text stands in a line "- `name` (unit): text" or "- `name` of what: text".
    """
    found: dict[str, tuple[str, str]] = {}
    for base in cls.__mro__:
        for name, more, text in FIELD.findall(docstring_of(base)):
            found.setdefault(name, (more, text))
    return found
