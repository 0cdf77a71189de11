"""What clients ask of a session, and what it tells them. All are JSON objects, one to a message.

**Operations**, from a client: `{"client": "a name of its own", "sequence": 12, "op": "connect", …}`; the classes below
and those of `_run_protocol` say which there are, and their fields. `at` is a list of names of subsystems, `[]` for the
outermost diagram; an `address` is `"block.port"` or `"block.parameter"`, of blocks in subsystems
`"subsystem/block.port"`.

**Events**, to clients; `"event"` has the name.

- Answers, to the one who asked: `done {client, sequence, revision}`; `refused {client, sequence, message, path?}`;
  `fragment {fragment}`; `text {text}`; `files {files}`; `log {log}`.
- `declarations {categories, blocks, gallery}`: after `hello`, once.
- `document {session, revision, view, file, saved, can_undo, can_redo}`: the whole; see `_views`.
- `changed {revision, file, saved, can_undo, can_redo, scopes}`: what is new in each diagram that changed.
- `problems {revision, list: [{path, port, message}]}`: all that keeps the diagram from running.
- `run {…}`: how the run stands; see `_runner`.
- `samples {branch, fresh, signals}`: what sinks and watched outputs saw; see `_traces`.
- `recoverable {list}`: work of sessions that ended unsaved; see `_autosave`.
- `saved {file}`, `replayed {branch, tick, matches}`, `error {message}`.
"""

import dataclasses
from typing import Any, ClassVar

Path = list[str]
Point = tuple[float, float]


@dataclasses.dataclass(frozen=True)
class Operation:
    """What a client asks for."""

    op: ClassVar[str]


@dataclasses.dataclass(frozen=True)
class Edit(Operation):
    """A change of the diagram `at`; it can be undone."""

    at: Path


@dataclasses.dataclass(frozen=True)
class Add(Edit):
    """Put in a new block, by default under the name of its type; `"diagram"` is an empty subsystem."""

    op: ClassVar[str] = "add"
    type: str
    name: str | None = None
    fields: dict[str, Any] = dataclasses.field(default_factory=dict)
    position: Point | None = None


@dataclasses.dataclass(frozen=True)
class Remove(Edit):
    """Take out blocks, with their wires; also `comments`, by their ids."""

    op: ClassVar[str] = "remove"
    names: list[str] = dataclasses.field(default_factory=list)
    comments: list[str] = dataclasses.field(default_factory=list)


@dataclasses.dataclass(frozen=True)
class Rename(Edit):
    """Give a block another name; one that is a port of a subsystem keeps its wires outside."""

    op: ClassVar[str] = "rename"
    name: str
    to: str


@dataclasses.dataclass(frozen=True)
class Set(Edit):
    """Set a field of a block, or several at once by `fields`; of the diagram itself (title, comment, tick, substeps)
    without a name."""

    op: ClassVar[str] = "set"
    name: str | None = None
    field: str | None = None
    value: Any = None
    fields: dict[str, Any] = dataclasses.field(default_factory=dict)

    @property
    def values(self) -> dict[str, Any]:
        """What is set to what."""
        return self.fields if self.field is None else {**self.fields, self.field: self.value}


@dataclasses.dataclass(frozen=True)
class Connect(Edit):
    """Lead a wire from an output, `"block.port"`, to an input; one that leads there is taken out."""

    op: ClassVar[str] = "connect"
    source: str
    target: str


@dataclasses.dataclass(frozen=True)
class Disconnect(Edit):
    """Take out the wire to an input."""

    op: ClassVar[str] = "disconnect"
    target: str


@dataclasses.dataclass(frozen=True)
class Move(Edit):
    """Put blocks elsewhere; and comments, by their ids: `boxes` are `[x, y, width, height]`."""

    op: ClassVar[str] = "move"
    positions: dict[str, Point] = dataclasses.field(default_factory=dict)
    boxes: dict[str, list[float]] = dataclasses.field(default_factory=dict)


@dataclasses.dataclass(frozen=True)
class Group(Edit):
    """Make a subsystem of blocks."""

    op: ClassVar[str] = "group"
    names: list[str]
    name: str | None = None


@dataclasses.dataclass(frozen=True)
class Ungroup(Edit):
    """Put the blocks of a subsystem in its place."""

    op: ClassVar[str] = "ungroup"
    name: str


@dataclasses.dataclass(frozen=True)
class Paste(Edit):
    """Put in the blocks of a document, under new names where theirs are taken."""

    op: ClassVar[str] = "paste"
    fragment: dict[str, Any]
    position: Point | None = None


@dataclasses.dataclass(frozen=True)
class Comment(Edit):
    """Write a new comment, or another text in the one with this id; `box` is `[x, y, width, height]`."""

    op: ClassVar[str] = "comment"
    text: str
    box: list[float] | None = None
    id: str | None = None


@dataclasses.dataclass(frozen=True)
class ParameterEdit(Operation):
    """Set a parameter, in the document and in the run, from its next tick on. Quick changes of one are undone as
    one."""

    op: ClassVar[str] = "parameter"
    address: str
    value: Any


@dataclasses.dataclass(frozen=True)
class Freeze(Operation):
    """Freeze what a block has learnt, or let it learn on: of all it has, or of one of its units."""

    op: ClassVar[str] = "freeze"
    address: str
    on: bool
    unit: int | None = None


@dataclasses.dataclass(frozen=True)
class Undo(Operation):
    """Take back the last change of the document."""

    op: ClassVar[str] = "undo"


@dataclasses.dataclass(frozen=True)
class Redo(Operation):
    """Make again what was taken back."""

    op: ClassVar[str] = "redo"


@dataclasses.dataclass(frozen=True)
class Open(Operation):
    """Work on another diagram: from a text, the gallery, or a file in the session's folder. It can be undone."""

    op: ClassVar[str] = "open"
    text: str | None = None
    gallery: str | None = None
    file: str | None = None


@dataclasses.dataclass(frozen=True)
class New(Operation):
    """Work on an empty diagram. It can be undone."""

    op: ClassVar[str] = "new"


@dataclasses.dataclass(frozen=True)
class Save(Operation):
    """Write the diagram to its file, or to another in the session's folder; `over` says that it may replace one."""

    op: ClassVar[str] = "save"
    file: str | None = None
    over: bool = False


@dataclasses.dataclass(frozen=True)
class Recover(Operation):
    """Take up unsaved work of a session that ended, or (`drop`) forget it."""

    op: ClassVar[str] = "recover"
    id: str
    drop: bool = False


@dataclasses.dataclass(frozen=True)
class Hello(Operation):
    """The first message of a connection; with the session and revision that the client has, if it was lost."""

    op: ClassVar[str] = "hello"
    session: str | None = None
    revision: int | None = None


@dataclasses.dataclass(frozen=True)
class Fragment(Operation):
    """Ask for blocks as a document, to be pasted elsewhere: the answer is `fragment`."""

    op: ClassVar[str] = "fragment"
    at: Path
    names: list[str]


@dataclasses.dataclass(frozen=True)
class Text(Operation):
    """Ask for the diagram as the text of a file, or as Python."""

    op: ClassVar[str] = "text"
    python: bool = False


@dataclasses.dataclass(frozen=True)
class Files(Operation):
    """Ask for the names of the diagrams in the session's folder."""

    op: ClassVar[str] = "files"
