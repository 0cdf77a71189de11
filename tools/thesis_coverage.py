"""What of the thesis is here, item by item: `python -m tools.thesis_coverage` makes docs/thesis-coverage.md.

`docs/data/thesis-coverage.toml` names for every item of the thesis the entries of registries that have it. What
experiments found comes from `docs/data/reproduction.json`. A name that no registry has is an error, so that the page
stays true.
"""

import collections
import dataclasses
import functools
import importlib
import json
import tomllib
from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

from motorgrad._errors import choice
from motorgrad._files import write_atomically
from motorgrad.bodies import BODIES
from motorgrad.commands import COMMANDS
from motorgrad.learning import PRESETS, Estimator
from motorgrad.policies import INITIAL
from motorgrad.schema import PART_CLASSES, name_in_words
from motorgrad.tasks import TASKS
from motorgrad_thesis import EXPERIMENTS
from motorgrad_thesis._score import STANDINGS
from timlab.blocks import BLOCKS
from timlab.gallery import GALLERY

DOCS = Path(__file__).parents[1] / "docs"
DATA = DOCS / "data" / "thesis-coverage.toml"
RESULTS = DOCS / "data" / "reproduction.json"
PAGE = DOCS / "thesis-coverage.md"
HEAD = """# What of the thesis is here

Item by item: what the thesis describes, proposes or claims, in the order of its sections, and where it is.
Experiments are run by `motorgrad reproduce NAME`; behind each is how many statements of the thesis it found to hold.
Those that are refuted are listed, with reasons, on [reproduction](reproduction.md); how we read the text where it is
silent or misprinted, in [deviations](decisions/deviations-from-the-thesis.md).

This page is made by `python -m tools.thesis_coverage`, from the registries of experiments and parts: a name that no
longer exists is an error of the tests.
"""


@dataclasses.dataclass(frozen=True)
class Item:
    """Something that the thesis says.

    - `section`: where; `says`: what, in our own words.
    - `where`: where it is here, as `KIND:NAME`; nothing if it is not.
    - `lacks`: what is not here, or differs.
    """

    section: str
    says: str
    where: tuple[str, ...] = ()
    lacks: str = ""

    @property
    def standing(self) -> str:
        """How much of it is here: `"whole"`, `"in part"` or `"missing"`."""
        if not self.where:
            return "missing"
        return "in part" if self.lacks else "whole"


Chapters = dict[tuple[str, str], list[Item]]
"""Items by number and title of their chapter."""


def items() -> Chapters:
    """Every item, by chapter. **Raises** `TypeError` for a key that an item does not have."""
    stored = tomllib.loads(DATA.read_text(encoding="utf-8"))
    return {
        (chapter["number"], chapter["title"]): [
            Item(**{**item, "where": tuple(item.get("where", ()))}) for item in chapter["items"]
        ]
        for chapter in stored["chapter"]
    }


@functools.cache
def registries() -> Mapping[str, Collection[str]]:
    """The names of each kind of place."""
    parts = {name_in_words(place).replace(" ", "-"): kinds for place, kinds in PART_CLASSES.items()}
    return parts | {
        "experiment": EXPERIMENTS,
        "task": TASKS,
        "policy": INITIAL,
        "preset": PRESETS,
        "estimator": Estimator.presets,
        "body": BODIES,
        "block": BLOCKS,
        "diagram": GALLERY,
        "command": COMMANDS,
        "page": [path.relative_to(DOCS).as_posix() for path in DOCS.rglob("*.md")],
    }


PAGES = {
    "policy": "policies.md",
    "preset": "which-preset.md",
    "body": "bodies.md",
    "block": "lab.md",
    "diagram": "lab.md",
    "command": "command-line.md",
}
"""Where the things of a kind are described; those of other kinds in `learning.md`."""


def shown(reference: str) -> str:
    """A place in Markdown, with a link. **Raises** `ValueError` if there is no such place."""
    kind, _, name = reference.partition(":")
    if kind == "python":
        module, _, attribute = name.rpartition(".")
        if not hasattr(importlib.import_module(module), attribute):
            raise ValueError(f"{name}: no such name")
        return f"`{name}`"
    choice("kind of a place", kind, registries())
    choice(kind, name, registries()[kind])
    if kind == "page":
        title = (DOCS / name).read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        return f"[{title}]({name})"
    if kind == "experiment":
        return f"[`{name}`]({_page_of(name)}){_found(name)}"
    page = f"tasks/{name}.md" if kind == "task" else PAGES.get(kind, "learning.md")
    words = kind.replace("-", " ")
    return f"{words} [`{name}`]({page})"


def _page_of(experiment: str) -> str:
    """The page that tells most of an experiment."""
    pages = sorted(DOCS.glob("reproduction*.md"))
    counts = {page.name: page.read_text(encoding="utf-8").count(experiment) for page in pages}
    del counts["reproduction.md"]  # it names all of them
    best = max(counts, key=lambda name: counts[name])
    return best if counts[best] else "reproduction.md"


def _found(experiment: str) -> str:
    """How its statements stand, such as ` (3 hold, 1 refuted)`."""
    statements = json.loads(RESULTS.read_text(encoding="utf-8")).get(experiment, [])
    count = collections.Counter(each["standing"] for each in statements)
    verbs = {"holds": "holds" if count["holds"] == 1 else "hold"}
    words = ", ".join(f"{count[each]} {verbs.get(each, each)}" for each in STANDINGS if count[each])
    return f" ({words})" if words else ""


def page() -> str:
    """The whole page."""
    chapters = items()
    standings = ("whole", "in part", "missing")
    lines = [HEAD, f"| chapter | {' | '.join(standings)} |", "|---" * (1 + len(standings)) + "|"]
    for (number, title), found in chapters.items():
        count = collections.Counter(item.standing for item in found)
        lines.append(f"| {number}: {title} | {' | '.join(str(count[each]) for each in standings)} |")
    for (number, title), found in chapters.items():
        lines += ["", f"## {number}: {title}", "", "| section | what the thesis says | where it is |", "|---|---|---|"]
        lines += [f"| {item.section} | {item.says} | {_places(item)} |" for item in found]
    return "\n".join(lines) + "\n"


def _places(item: Item) -> str:
    places = "; ".join(map(shown, item.where)) or "nowhere"
    return f"{places}. **Not here:** {item.lacks}" if item.lacks else places


def named() -> set[str]:
    """The experiments that some item names."""
    references: list[Any] = [each for found in items().values() for item in found for each in item.where]
    return {each.partition(":")[2] for each in references if each.startswith("experiment:")}


if __name__ == "__main__":
    write_atomically(PAGE, page().encode())
