"""The editor's protocol: the operations that clients send, and the events that they receive. All are JSON objects, one
per message.

**Operations** come from a client: `{"client": "a name of its own", "sequence": 12, "op": "connect", …}`. Each is a
class below, in `_edits` or in `_masks`, whose fields are the operation's. `at` is a list of names of subsystems, `[]`
for the outermost diagram. An `address` is `"block.port"` or `"block.parameter"`; a block in a subsystem is
`"subsystem/block.port"`.

**Events** go to clients; `"event"` is the name.

- Answers to the client that asked: `done {client, sequence, revision}`; `refused {client, sequence, message, path?}`;
  `fragment {fragment}`; `text {text}`; `files {files}`; `log {log}`; `page {text}`.
- `declarations {categories, blocks, gallery, words}`: once, after `hello`.
- `document {session, revision, view, file, saved, can_undo, can_redo}`: the whole document; see `_views`.
- `changed {revision, file, saved, can_undo, can_redo, scopes}`: what is new in each diagram that changed.
- `problems {revision, list: [{path, port, message}], warnings, shapes, foreign}`: everything that keeps the diagram
  from running; `warnings` of the same form about one that runs, see `_warnings`; `shapes` of ports that follow from
  wires, by address, other than `()`; and `foreign`, code that does not run before it is trusted, see `_trust`.
- `run {…}`: the state of the run; see `_runner`.
- `samples {branch, fresh, signals}`: what sinks and watched outputs recorded; see `_traces`.
- `recoverable {list}`: unsaved work of sessions that have ended; see `_storage`.
- `saved {file}`, `replayed {branch, tick, matches}`, `error {message}`.
"""

import dataclasses
import json
from typing import Any, ClassVar

from motorgrad._errors import check, choice
from motorgrad.schema import build
from timlab.diagram import check_data

MAX_MESSAGE_CHARACTERS = 50_000_000
OPERATIONS: "dict[str, type[Operation]]" = {}
"""Every operation by its name in messages."""


@dataclasses.dataclass(frozen=True)
class Operation:
    """What a client asks for.

    A subclass is registered in `OPERATIONS` under its own name in lower case, or under `op`; `op=""` makes it abstract.
    """

    op: ClassVar[str]

    def __init_subclass__(cls, op: str | None = None):
        cls.op = cls.__name__.lower() if op is None else op
        if cls.op:
            OPERATIONS[cls.op] = cls


@dataclasses.dataclass(frozen=True)
class Hello(Operation):
    """The first message of a connection. A client that reconnects gives the session and revision that it has."""

    session: str | None = None
    revision: int | None = None


@dataclasses.dataclass(frozen=True)
class Undo(Operation):
    """Undo the last change of the document."""


@dataclasses.dataclass(frozen=True)
class Redo(Operation):
    """Redo the last change that was undone."""


@dataclasses.dataclass(frozen=True)
class Open(Operation):
    """Open another diagram: a text, an example from the gallery, or a file in the session's folder. It can be
    undone."""

    text: str | None = None
    gallery: str | None = None
    file: str | None = None


@dataclasses.dataclass(frozen=True)
class New(Operation):
    """Open an empty diagram. It can be undone."""


@dataclasses.dataclass(frozen=True)
class Save(Operation):
    """Save the diagram to its file, or to another one in the session's folder; `over` allows replacing a file."""

    file: str | None = None
    over: bool = False


@dataclasses.dataclass(frozen=True)
class Recover(Operation):
    """Recover the unsaved work of a session that has ended, or discard it (`drop`)."""

    id: str
    drop: bool = False


@dataclasses.dataclass(frozen=True)
class Trust(Operation):
    """Allow code from a file to run, by the keys that `problems` lists under `foreign`."""

    keys: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Fragment(Operation):
    """Copy blocks as a document that can be pasted. The answer is `fragment`."""

    at: tuple[str, ...]
    names: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Text(Operation):
    """Get the diagram as the text of a file, or as Python. The answer is `text`."""

    python: bool = False


@dataclasses.dataclass(frozen=True)
class Files(Operation):
    """List the diagrams in the session's folder. The answer is `files`."""


@dataclasses.dataclass(frozen=True)
class RunOperation(Operation, op=""):
    """An operation on the run, performed in the run's thread. `branch` is the name of a branch."""


@dataclasses.dataclass(frozen=True)
class Play(RunOperation):
    """Run at `speed` simulated seconds per second, or as fast as possible without a speed."""

    speed: float | None = None


@dataclasses.dataclass(frozen=True)
class Speed(RunOperation):
    """Change the speed of a run that plays."""

    speed: float | None = None


@dataclasses.dataclass(frozen=True)
class Pause(RunOperation):
    """Pause after the tick in progress."""


@dataclasses.dataclass(frozen=True)
class Tick(RunOperation):
    """Run `n` ticks, in addition to those requested earlier that are still pending, then pause."""

    n: int = 1


@dataclasses.dataclass(frozen=True)
class Reset(RunOperation):
    """Restart at tick 0 with the current diagram, and discard all branches."""


@dataclasses.dataclass(frozen=True)
class Seeds(RunOperation):
    """Restart with the seeds 0 … n − 1, or with a list of seeds."""

    n: int | tuple[int, ...]


@dataclasses.dataclass(frozen=True)
class Watch(RunOperation):
    """Record these outputs, and stop recording all others."""

    addresses: tuple[str, ...]


@dataclasses.dataclass(frozen=True)
class Scrub(RunOperation):
    """Go to a tick that a branch has already reached; later ticks are kept."""

    branch: str
    tick: int


@dataclasses.dataclass(frozen=True)
class Fork(RunOperation):
    """Begin a new branch at a tick of another one, by default at its current tick."""

    branch: str
    tick: int | None = None
    name: str | None = None


@dataclasses.dataclass(frozen=True)
class Prune(RunOperation):
    """Delete a branch."""

    branch: str


@dataclasses.dataclass(frozen=True)
class Log(RunOperation):
    """Get the log of a branch, by default the current one: everything that determines its numbers. The answer is
    `log`."""

    branch: str | None = None


@dataclasses.dataclass(frozen=True)
class Page(RunOperation):
    """Get the diagram and everything its run recorded as one HTML page that needs no server. The answer is `page`."""


@dataclasses.dataclass(frozen=True)
class Replay(RunOperation):
    """Replay a log as a new set of branches, and report whether it ends in the same state bit for bit."""

    log: dict[str, Any]


def read_message(text: str) -> tuple[str, int, Operation]:
    """Parse a message into client, sequence number and operation.

    **Raises** `ValueError` that names the wrong field.
    """
    check(len(text) <= MAX_MESSAGE_CHARACTERS, "message", text, f"at most {MAX_MESSAGE_CHARACTERS:,} characters")
    try:
        data = json.loads(text, parse_constant=_refuse_constant)
    except RecursionError:
        raise ValueError("message: has too many nested lists") from None
    check(isinstance(data, dict), "message", data, "a JSON object")
    client = data.pop("client", None)
    sequence = data.pop("sequence", None)
    check(is_client(client), "client", client, "a string of 1 to 100 characters")
    check(is_sequence(sequence), "sequence", sequence, "an integer from 0")
    return client, sequence, operation_from(data)


def is_client(client: object) -> bool:
    """Whether this can be the name of a client."""
    return isinstance(client, str) and 0 < len(client) <= 100


def is_sequence(sequence: object) -> bool:
    """Whether this can be the number of a message."""
    return type(sequence) is int and 0 <= sequence < 2**63


def operation_from(data: dict[str, Any]) -> Operation:
    """The operation that a JSON object describes. **Raises** `ValueError` that names the wrong field."""
    check_data(data)  # what no file may contain could neither be saved nor sent
    fields = dict(data)
    op = fields.pop("op", None)
    choice("op", op, OPERATIONS)
    return build(OPERATIONS[op], fields, op)


def operation_data(operation: Operation) -> dict[str, Any]:
    """An operation as a JSON object, the inverse of `operation_from`."""
    return {"op": operation.op, **dataclasses.asdict(operation)}


def event_text(event: dict[str, Any]) -> str:
    """An event as a message. In place of one that is not JSON there is an error, so that the others still arrive."""
    try:
        text = json.dumps(event, ensure_ascii=False, allow_nan=False)
    except (TypeError, ValueError) as error:
        return event_text({"event": "error", "message": f"{event['event']}: cannot be sent: {error}"})
    return text.encode("utf-8", "backslashreplace").decode()  # names of files may hold bytes that are no text


def _refuse_constant(constant: str) -> None:
    raise ValueError(f"message: contains {constant}: must have finite numbers")
