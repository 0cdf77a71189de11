"""What clients ask of a session, and what it tells them. All are JSON objects, one to a message.

**Operations**, from a client: `{"client": "a name of its own", "sequence": 12, "op": "connect", …}`; the classes below
say which there are, and their fields. `at` is a list of names of subsystems, `[]` for the outermost diagram; an
`address` is `"block.port"` or `"block.parameter"`, of blocks in subsystems `"subsystem/block.port"`.

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
import json
import types
import typing
from typing import Any, ClassVar

from motorgrad._errors import check, choice

Path = list[str]
Point = tuple[float, float]
LARGEST = 50_000_000  # characters of a message


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


@dataclasses.dataclass(frozen=True)
class Play(Operation):
    """Run: at a `speed` of so many simulated seconds in one, or as quickly as possible without."""

    op: ClassVar[str] = "play"
    speed: float | None = None


@dataclasses.dataclass(frozen=True)
class Speed(Operation):
    """Another speed."""

    op: ClassVar[str] = "speed"
    speed: float | None = None


@dataclasses.dataclass(frozen=True)
class Pause(Operation):
    """Stop after the tick that is being made."""

    op: ClassVar[str] = "pause"


@dataclasses.dataclass(frozen=True)
class Tick(Operation):
    """Make `n` ticks, and pause."""

    op: ClassVar[str] = "tick"
    n: int = 1


@dataclasses.dataclass(frozen=True)
class Reset(Operation):
    """Begin again at tick 0 with the diagram as it stands, and forget all branches."""

    op: ClassVar[str] = "reset"


@dataclasses.dataclass(frozen=True)
class Seeds(Operation):
    """Begin again with so many seeds, 0 … n − 1, or with this list of them."""

    op: ClassVar[str] = "seeds"
    n: int | list[int]


@dataclasses.dataclass(frozen=True)
class Watch(Operation):
    """Look also at these outputs; those that were watched before and are not in the list are no longer."""

    op: ClassVar[str] = "watch"
    addresses: list[str]


@dataclasses.dataclass(frozen=True)
class Scrub(Operation):
    """Go to a tick that a branch has made; what follows it stays."""

    op: ClassVar[str] = "scrub"
    branch: str
    tick: int


@dataclasses.dataclass(frozen=True)
class Fork(Operation):
    """Begin a new branch at a tick of another, by default where that is."""

    op: ClassVar[str] = "fork"
    branch: str
    tick: int | None = None
    name: str | None = None


@dataclasses.dataclass(frozen=True)
class Prune(Operation):
    """Forget a branch."""

    op: ClassVar[str] = "prune"
    branch: str


@dataclasses.dataclass(frozen=True)
class Log(Operation):
    """Ask for the log of a branch, by default of the present one: all that its numbers follow from."""

    op: ClassVar[str] = "log"
    branch: str | None = None


@dataclasses.dataclass(frozen=True)
class Replay(Operation):
    """Run a log again, as a new set of branches, and see whether the end is the same bit for bit."""

    op: ClassVar[str] = "replay"
    log: dict[str, Any]


def _all(kind: type[Operation]) -> dict[str, type[Operation]]:
    found = {} if "op" not in vars(kind) else {kind.op: kind}
    for below in kind.__subclasses__():
        found |= _all(below)
    return found


OPERATIONS = _all(Operation)


def read(text: str) -> tuple[str, int, Operation]:
    """A message as client, sequence and operation. **Raises** `ValueError` that names the field that is wrong."""
    check(len(text) <= LARGEST, "message", text, f"at most {LARGEST:,} characters")
    try:
        data = json.loads(text, parse_constant=_refuse)
    except RecursionError:
        raise ValueError("message: has too many lists within each other") from None
    check(isinstance(data, dict), "message", data, "a JSON object")
    client, sequence = data.pop("client", None), data.pop("sequence", None)
    check(isinstance(client, str) and 0 < len(client) <= 100, "client", client, "a text of 1 … 100 characters")
    check(_fits(int, sequence) and sequence >= 0, "sequence", sequence, "a whole number from 0")
    return client, sequence, operation(data)


def operation(data: dict[str, Any]) -> Operation:
    """The operation that a table describes."""
    data = dict(data)
    op = data.pop("op", None)
    choice("op", op, OPERATIONS)
    kind = OPERATIONS[op]
    hints = typing.get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind)}
    for name, value in data.items():
        choice(f"field of {op}", name, fields)
        check(_fits(hints[name], value), f"{op}: {name}", value, _words(hints[name]))
    for name, field in fields.items():
        given = field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING
        check(given or name in data, f"{op}: {name}", None, "given")
    return kind(**data)


def table(operation: Operation) -> dict[str, Any]:
    """The inverse of `operation`."""
    return {"op": operation.op, **dataclasses.asdict(operation)}


def _refuse(constant: str) -> None:
    raise ValueError(f"message: has {constant}: must have finite numbers")


def _fits(hint: Any, value: Any) -> bool:
    """Whether a value of JSON is of a type."""
    if hint is Any:
        return True
    if isinstance(hint, types.UnionType):
        return any(_fits(part, value) for part in typing.get_args(hint))
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin is list:
        return isinstance(value, list) and all(_fits(parts[0], each) for each in value)
    if origin is tuple:
        return isinstance(value, list) and len(value) == len(parts) and all(map(_fits, parts, value))
    if origin is dict:
        return isinstance(value, dict) and all(_fits(parts[1], each) for each in value.values())
    if hint in (int, float):
        number = isinstance(value, int) or (hint is float and isinstance(value, float))
        return number and not isinstance(value, bool) and abs(value) < 2**63
    return isinstance(value, hint)


def _words(hint: Any) -> str:
    """A type in words that complete "must be …"."""
    if isinstance(hint, types.UnionType):
        return " or ".join(_words(part) for part in typing.get_args(hint))
    origin, parts = typing.get_origin(hint), typing.get_args(hint)
    if origin is tuple:
        return f"a list of {len(parts)} numbers"
    if origin is list:
        return f"a list, each {_words(parts[0])}"
    plain = {str: "a text", int: "a whole number", float: "a finite number", bool: "true or false", dict: "a table"}
    return "null" if hint is type(None) else plain.get(origin or hint, "a value")
