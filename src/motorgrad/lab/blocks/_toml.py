"""Settings that are themselves a table, such as those of a task: as TOML in one text, which is plain data."""

import tomllib
from collections.abc import Mapping
from typing import Any

from motorgrad._errors import check

LONGEST = 100_000  # characters


def as_text(name: str, value: Any) -> str:
    """A table as TOML; a text stays as it is. **Raises** `ValueError` for what is neither."""
    check(isinstance(value, str | Mapping), name, value, "TOML, such as 'units = 8', or a mapping")
    if isinstance(value, Mapping):
        import tomli_w

        try:
            value = tomli_w.dumps(dict(value)).strip()
        except TypeError as error:
            raise ValueError(f"{name}: must be plain numbers, texts, lists and tables: {error}") from None
    read_table(name, value)
    return value


def read_table(name: str, text: Any) -> dict[str, Any]:
    """What a text of TOML says. **Raises** `ValueError` for what is no TOML."""
    check(isinstance(text, str) and len(text) <= LONGEST, name, text, f"a text of at most {LONGEST} characters")
    try:
        return tomllib.loads(text)
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise ValueError(f"{name} = {text!r}: must be TOML, such as 'units = 8': {error}") from None
