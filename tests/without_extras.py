"""A process without the extras of motorgrad: `python tests/without_extras.py -m MODULE …`, or `-c CODE`.

The packages that extras install beyond those of the library and of `dev` cannot be found in it, installed or not.
"""

import importlib.metadata
import runpy
import sys
from collections.abc import Iterable
from importlib.machinery import ModuleSpec
from typing import Any

from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

KEPT = "dev"


def closure(requirements: Iterable[str]) -> set[str]:
    """The normalized names of all installed packages that `requirements` ask for, directly or not."""
    left = [(Requirement(text), "") for text in requirements]
    seen: set[tuple[str, str]] = set()
    while left:
        requirement, asked_by = left.pop()
        if requirement.marker is not None and not requirement.marker.evaluate({"extra": asked_by}):
            continue
        for extra in ("", *requirement.extras):
            if (requirement.name, extra) in seen:
                continue
            seen.add((requirement.name, extra))
            try:
                asked = importlib.metadata.requires(requirement.name) or ()
            except importlib.metadata.PackageNotFoundError:
                asked = ()
            left += [(Requirement(text), extra) for text in asked]
    return {canonicalize_name(name) for name, _ in seen}


def modules_of_extras() -> set[str]:
    """The modules, by the names under which they are imported, that only extras install."""
    extras = set(importlib.metadata.metadata("motorgrad").get_all("Provides-Extra") or ()) - {KEPT}
    only = closure([f"motorgrad[{','.join(extras)}]"]) - closure([f"motorgrad[{KEPT}]"])
    found = importlib.metadata.packages_distributions()
    return {name for name, owners in found.items() if {canonicalize_name(owner) for owner in owners} <= only}


class _Without:
    """A finder of modules that finds what another does, but for some."""

    def __init__(self, finder: Any, hidden: set[str]):
        self._finder = finder
        self._hidden = hidden

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        return None if name.partition(".")[0] in self._hidden else self._finder.find_spec(name, path, target)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._finder, name)


def hide(modules: set[str]) -> None:
    """Let imports of modules fail as if they were not installed."""
    sys.meta_path[:] = [_Without(finder, modules) for finder in sys.meta_path]


if __name__ == "__main__":
    hide(modules_of_extras())
    _, kind, what, *rest = sys.argv
    sys.argv = [what, *rest]
    sys.path.insert(0, "")  # as Python does for -m and -c
    if kind == "-m":
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    else:
        exec(what)
