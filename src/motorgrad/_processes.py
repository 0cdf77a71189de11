"""Python processes in which no file of the working folder takes the place of a module.

For `-c` and `-m`, Python looks for modules in the working folder first. A folder may hold a stranger's files, and a
`struct.py` among them would run.
"""

import contextlib
import os
from collections.abc import Iterator, Mapping

SAFE = {"PYTHONSAFEPATH": "1"}
"""The variable by which Python does not look for modules in the working folder. Unlike the flag `-P`, processes pass it
on to those that they start: glfw, which MuJoCo loads, starts one when it is imported."""
IMPORTED: list[str] = []
"""The modules that `--import` named, which other processes of a command import, too."""


@contextlib.contextmanager
def environment(settings: Mapping[str, str] = SAFE) -> Iterator[None]:
    """Let processes that are started within the context, also by other libraries, have these variables; by default, so
    that their modules are not those of the working folder."""
    before = {name: os.environ.get(name) for name in settings}
    os.environ.update(settings)
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value
