"""Messages of clients, read: seen to be operations with the fields that these have."""

import dataclasses
import json
import types
import typing
from typing import Any

from motorgrad._errors import check, choice
from motorgrad.lab.editor import _run_protocol
from motorgrad.lab.editor._protocol import Operation

LARGEST = 50_000_000  # characters of a message


def _below(kind: type[Operation]) -> dict[str, type[Operation]]:
    found = {} if "op" not in vars(kind) else {kind.op: kind}
    for below in kind.__subclasses__():
        found |= _below(below)
    return found


OPERATIONS = _below(Operation)
"""All kinds of operations by name."""
assert all(kind.op in OPERATIONS for kind in _run_protocol.RUN)


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
