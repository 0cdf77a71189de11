"""A page of the documentation for each of TimLab's blocks, made from its declaration."""

import dataclasses
import re
from collections.abc import Iterator
from typing import Any

from motorgrad.schema import summary_of
from timlab import BLOCKS, GALLERY, Block, HostBlock, Sink, parameters_of, settings_of
from timlab.diagram import allowed_in, choices_of

FOLDER = "lab/blocks"
GALLERY_PAGE = "lab/gallery.md"


def block_pages() -> dict[str, str]:
    """The Markdown of every page by its path, the list of all blocks first."""
    pages = {f"{FOLDER}/index.md": _index(), GALLERY_PAGE: _gallery()}
    return pages | {f"{FOLDER}/{slug(name)}.md": _page(name, kind) for name, kind in BLOCKS.items()}


def navigation() -> list[Any]:
    """The pages in the order of the categories, as MkDocs takes them."""
    groups = [{group.capitalize(): [f"{FOLDER}/{slug(n)}.md" for n in names]} for group, names in _groups().items()]
    return [f"{FOLDER}/index.md", *groups]


def _groups() -> dict[str, list[str]]:
    groups: dict[str, list[str]] = {}
    for name, kind in BLOCKS.items():
        groups.setdefault(kind.category, []).append(name)
    return {group: sorted(names) for group, names in sorted(groups.items())}


def _index() -> str:
    lines = ["# Blocks", "", "All types of blocks, with what each is for.", ""]
    for group, names in _groups().items():
        lines += [f"## {group.capitalize()}", "", "| block | |", "|---|---|"]
        lines += [f"| [{name}]({slug(name)}.md) | {_cell(_summary(BLOCKS[name]))} |" for name in names] + [""]
    return "\n".join(lines)


def _gallery() -> str:
    lines = [
        "# Gallery",
        "",
        "Ready diagrams, each with what to try. Open one with `motorgrad lab --gallery NAME`; in Python,",
        "`timlab.example(name)` returns it.",
        "",
    ]
    for name, make in GALLERY.items():
        diagram = make()
        title = diagram.title or name
        lines += [f"## {title}", "", f"`{name}`, {len(diagram.nodes)} blocks. {diagram.comment}", ""]
        lines += [f"![The diagram {title}](../images/lab-{name}.svg)", ""]
    return "\n".join(lines)


def _page(name: str, kind: type[Block]) -> str:
    lines = [f"# {name}", "", summary_of(kind), ""]
    lines += [f"In Python `timlab.{kind.__name__}`, in files `{name}`; {', '.join(_manner(kind))}.", ""]
    try:
        block = kind()
    except (TypeError, ValueError):
        lines += ["What ports it has depends on settings that must be given.", ""]
    else:
        for side in ("inputs", "outputs"):
            lines += _ports(side, getattr(block, side))
    lines += _fields("Parameters, which may change while it runs", kind, parameters_of(kind))
    lines += _fields("Settings", kind, settings_of(kind))
    return "\n".join(lines)


def _manner(kind: type[Block]) -> Iterator[str]:
    if issubclass(kind, HostBlock):
        yield "runs on the host, between compiled parts"
    elif issubclass(kind, Sink):
        yield "records what comes in"
    elif kind.derivative is not Block.derivative:
        yield "moves continuously"
    elif kind.update is not Block.update:
        yield "has a state, once a tick"
    else:
        yield "has no state"
    if kind.uniforms is not Block.uniforms:
        yield "draws random numbers"


def _ports(side: str, ports: Any) -> list[str]:
    if not ports:
        return []
    waits = side == "inputs"
    lines = [f"## {side.capitalize()}", "", "With the settings as they are at first:", ""]
    lines += ["| port | carries | without a wire | acts | |", "|---|---|---|---|---|"] if waits else []
    lines += [] if waits else ["| port | carries | |", "|---|---|---|"]
    for name, port in ports.items():
        carries = port.describe() + (f", {port.unit}" if port.unit else "")
        help = _cell(port.help)
        usual = "needs one" if port.default is None else f"{port.default:g}"
        acts = "at once" if port.feedthrough else "from the next tick on"
        lines.append(
            f"| `{name}` | {carries} | {usual} | {acts} | {help} |" if waits else f"| `{name}` | {carries} | {help} |"
        )
    return [*lines, ""]


def _fields(title: str, kind: type[Block], declared: Any) -> list[str]:
    if not declared:
        return []
    usual = {field.name: field.default for field in dataclasses.fields(kind)}
    limits = {name: _cell(_allowed(kind, name)) for name in declared}
    some = any(limits.values())
    lines = [
        f"## {title}",
        "",
        f"| | at first |{' may be |' if some else ''} |",
        f"|---|---|{'---|' if some else ''}---|",
    ]
    for name, part in declared.items():
        first = "must be given" if usual[name] is dataclasses.MISSING else f"`{usual[name]!r}`"
        cells = [f"`{name}`", _cell(first), *([limits[name]] if some else []), _cell(part.help)]
        lines.append(f"| {' | '.join(cells)} |")
    return [*lines, ""]


def _allowed(kind: type[Block], name: str) -> str:
    return allowed_in(kind, name) or ", ".join(f"`{choice!r}`" for choice in choices_of(kind, name))


def _summary(kind: type[Block]) -> str:
    return summary_of(kind).split("\n\n")[0]


def _cell(text: str) -> str:
    return " ".join(text.split()).replace("|", "\\|")


def slug(name: str) -> str:
    """The name of a block as that of its page."""
    return re.sub(r"[^a-z0-9]+", "-", name.lower()).strip("-")
