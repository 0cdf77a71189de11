"""A diagram and its run as one page that opens without a server: the editor shows recorded events."""

import html
import json
from typing import Any

from motorgrad._errors import check
from timlab.compiler import problems
from timlab.diagram import SUBSYSTEM, Diagram, Record, blocks_of, dumps
from timlab.editor._static import NOT_BUILT, STATIC
from timlab.editor._traces import Traces
from timlab.editor._views import declarations, shapes, view

Event = dict[str, Any]
STRETCHES = 2000  # by which a signal is shown; each has its least and its greatest number
POLICY = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:"
PAGE = """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta http-equiv="Content-Security-Policy" content="{policy}">
<title>{title}</title>
<style>{style}</style>
</head>
<body>
<div id="root"></div>
<script type="application/json" id="recording">{recording}</script>
<script type="module">{script}</script>
</body>
</html>
"""


def page(diagram: Diagram, run: Event, samples: list[Event]) -> str:
    """The page of a diagram, the last complete `run` event, and the `samples` events of its branches.

    **Raises** `ValueError` where the pages of the editor are not built.
    """
    script = STATIC / "viewer.js"
    style = STATIC / "viewer.css"
    check(script.is_file() and style.is_file(), "page", str(script), f"a file: {NOT_BUILT}")
    found = [problem._asdict() for problem in problems(diagram)]
    flags = {"revision": 0, "file": None, "saved": True, "can_undo": False, "can_redo": False}
    state = "empty" if run.get("branch") is None else "paused"
    events: list[Event] = [
        {"event": "declarations", **_declared(diagram)},
        {"event": "document", "session": "recording", **flags, "view": view(diagram)},
        {"event": "problems", "revision": 0, "list": found, "warnings": [], "shapes": shapes(diagram), "foreign": []},
        {**run, "event": "run", "state": state, "fixed": None, "stale": False},
        *samples,
        {"event": "text", "text": dumps(diagram)},
    ]
    text = json.dumps({"events": events}, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return PAGE.format(
        policy=POLICY,
        title=html.escape(diagram.title or "TimLab"),
        style=style.read_text(encoding="utf-8").replace("</style", "<\\/style"),
        recording=text.replace("<", "\\u003c"),
        script=script.read_text(encoding="utf-8").replace("</script", "<\\/script"),
    )


def page_of(diagram: Diagram, record: Record) -> str:
    """The page of a diagram with a record of its run. See `timlab.to_html`."""
    signals = list(record.signals.values())
    seeds = list(range(len(signals[0]) if signals else 1))
    last = record.first + record.ticks
    sinks = {f"{path}.{port}" for path, block in blocks_of(diagram).items() for port in block.inputs}
    run: Event = {"branch": "main", "tick": last, "time": last * record.tick, "head": last, "seeds": seeds}
    run |= {"speed": 1.0, "achieved": None, "waited": None, "overrides": {}, "fresh": [], "faults": []}
    run |= {"watch": [address for address in record.signals if address not in sinks]}
    run |= {"branches": [{"name": "main", "parent": None, "start": 0, "head": last, "edited": False, "changes": []}]}
    traces = Traces(diagram, seeds, STRETCHES)
    traces.add(record)
    return page(diagram, run, [{"event": "samples", "branch": "main", "fresh": True, "signals": traces.all()}])


def _declared(diagram: Diagram) -> Event:
    """The declarations of the blocks in a diagram, without the gallery's."""
    whole = declarations()
    used = {SUBSYSTEM, *(block.name for block in blocks_of(diagram).values())}
    blocks = {name: declared for name, declared in whole["blocks"].items() if name in used}
    return {**whole, "blocks": blocks, "gallery": []}
