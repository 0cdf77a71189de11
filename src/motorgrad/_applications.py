"""What other distributions add to this one: commands, films, blocks of diagrams. They are found by their entry points.

A distribution offers a thing under a name, in the group `motorgrad.commands` for a command of the command line, and in
`motorgrad.offers` for all else: `{"film": "timsim:write_film"}`. So nothing here imports an application.
"""

import functools
import importlib.metadata
from collections.abc import Mapping
from typing import Any

from motorgrad._extras import FILM, MissingExtra, install, require

OFFERED_COMMANDS = "motorgrad.commands"
"""The group of entry points whose names are commands, each a function of its arguments that returns an exit status."""
LISTS = "motorgrad.lists"
"""The group of what `motorgrad list` shows beside the library's own: functions without arguments that return words by
name."""
OFFERS = "motorgrad.offers"
"""The group of all else that an application offers."""
PICTURES = ("a picture needs", "sim")
"""What `offered` is given, after the name, before anything is drawn."""


def offered(name: str, what: str, extra: str, group: str = OFFERS) -> Any:
    """What an installed application offers under the `name` of its entry point, imported. **Raises** `MissingExtra`
    where no installed distribution offers it, which says `what` needs it, such as "a film needs", and the `extra` that
    installs one."""
    found = entries(group).get(name)
    if found is None:
        raise MissingExtra(f"{what} more than the library: {install(extra)}")
    return found.load()


def film_maker(name: str) -> Any:
    """The same of what makes films (.mp4). **Raises** `MissingExtra` also without the package that writes them."""
    made = offered(name, FILM[0], FILM[2])
    require(*FILM)
    return made


@functools.cache
def entries(group: str) -> Mapping[str, importlib.metadata.EntryPoint]:
    """The entry points of a group by name; nothing is imported."""
    return {each.name: each for each in importlib.metadata.entry_points(group=group)}
