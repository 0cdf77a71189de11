"""A process without the extras of motorgrad: `python tests/without_extras.py -m MODULE …`, or `-c CODE`.

The packages that extras install beyond those of the library and of `dev`, TimSim, TimLab and the thesis among them,
cannot be found in it, installed or not: neither their modules nor what they offer.
"""

import importlib.metadata
import runpy
import sys
from collections.abc import Iterable, Iterator
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


def distributions_of_extras() -> set[str]:
    """The normalized names of the packages that only extras install."""
    extras = set(importlib.metadata.metadata("motorgrad").get_all("Provides-Extra") or ()) - {KEPT}
    return closure([f"motorgrad[{','.join(extras)}]"]) - closure([f"motorgrad[{KEPT}]"])


def modules_of(distributions: set[str]) -> set[str]:
    """The modules, by the names under which they are imported, that only these packages install."""
    found = importlib.metadata.packages_distributions()
    # of an editable package no module is listed; those of the checkout have the names of their packages
    own = {name.replace("-", "_") for name in distributions}
    return own | {
        name for name, owners in found.items() if {canonicalize_name(owner) for owner in owners} <= distributions
    }


class _Without:
    """A finder of modules and distributions that finds what another does, but for some."""

    def __init__(self, finder: Any, distributions: set[str], modules: set[str]):
        self._finder = finder
        self._distributions = distributions
        self._modules = modules

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        return None if name.partition(".")[0] in self._modules else self._finder.find_spec(name, path, target)

    def find_distributions(self, *context: Any) -> Iterator[importlib.metadata.Distribution]:
        find = getattr(self._finder, "find_distributions", lambda *_: ())
        return (each for each in find(*context) if canonicalize_name(each.name) not in self._distributions)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._finder, name)


def hide(distributions: set[str]) -> None:
    """Let packages be as if they were not installed."""
    modules = modules_of(distributions)
    sys.meta_path[:] = [_Without(finder, distributions, modules) for finder in sys.meta_path]


if __name__ == "__main__":
    hide(distributions_of_extras())
    _, kind, what, *rest = sys.argv
    sys.argv = [what, *rest]
    sys.path.insert(0, "")  # as Python does for -m and -c
    if kind == "-m":
        runpy.run_module(what, run_name="__main__", alter_sys=True)
    else:
        exec(what)
