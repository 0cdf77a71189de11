"""Operations that somebody, or something, has spoilt: each is answered, on one line, and the session goes on."""

import copy
import dataclasses
import json
import random

import pytest
from editor_clients import Client

import timlab
from timlab.editor import Session
from timlab.editor._protocol import OPERATIONS, RunOperation

NAMES = ["gain", "scope", "sine", "sub", "gain 2", "u"]
SOUND = {
    **{"at": [[], [], ["sub"]], "type": ["gain", "scope", "diagram", "inlet", "integrator"], "name": [None, *NAMES]},
    **{"names": [["gain"], NAMES[:2], NAMES], "source": ["gain.y", "sine.y", "sub.u"], "target": ["gain.u", "scope.u"]},
    **{"address": ["gain.gain", "sine.amplitude"], "value": [1.0, 2], "to": NAMES, "position": [[1, 2]]},
    **{"fields": [{}, {"gain": 2.0}], "field": ["gain", "title", "tick"], "text": [timlab.dumps(timlab.Diagram())]},
    **{"file": ["a", "b.json", "evil.py", "../x"], "n": [1, 3], "branch": ["main"], "tick": [0, 1], "speed": [None]},
}
ODD = [True, -1, 0, 1, 2**31, 2**70, 1e30, 1e-30, 0.5, None, "", "x", "a.b", "../x", "\x00", "é" * 300, "<b>", "gain"]
ODD += [[], [[]], [1, 2], [[1, 2], [3]], [["a"]], ["gain"], {}, {"a": 1}]
LONGEST = 3000  # characters of a refusal, which may list what is known


def message(chance: random.Random, sequence: int) -> str:
    """The text of an operation, spoilt in some places."""
    op = chance.choice([name for name, kind in OPERATIONS.items() if not issubclass(kind, RunOperation)])
    fields: dict = {"client": "tester", "sequence": sequence, "op": op}
    for field in dataclasses.fields(OPERATIONS[op]):
        if chance.random() < 0.85:
            sound = field.name in SOUND and chance.random() < 0.75
            fields[field.name] = copy.deepcopy(chance.choice(SOUND[field.name] if sound else ODD))
    for _ in range(chance.choice([0, 0, 0, 1, 2])):
        fields[chance.choice([*fields, "new", "at"])] = copy.deepcopy(chance.choice(ODD))
    text = json.dumps(fields)
    if chance.random() < 0.05:
        at = chance.randrange(len(text))
        text = text[:at] + chance.choice('{}[]",:0aN') + text[at + 1 :]
    return text


def diagram() -> timlab.Diagram:
    inner, outer = timlab.Diagram(), timlab.Diagram()
    inner.add("u", timlab.Inlet(0.0))
    inner.add("y", timlab.Outlet())
    inner.connect("u", "y")
    for name, block in {"sine": timlab.Sine(), "gain": timlab.Gain(), "scope": timlab.Scope(), "sub": inner}.items():
        outer.add(name, block)
    return outer


@pytest.mark.parametrize("count", [500, pytest.param(10_000, marks=pytest.mark.slow)])
def test_a_spoilt_operation_is_answered_and_the_session_goes_on(count, tmp_path):
    chance, seen = random.Random(count), {"done": 0, "refused": 0}
    states = tmp_path / "states"
    session = Session(diagram(), folder=tmp_path, states=states)
    for sequence in range(count):
        text, answers = message(chance, sequence), []
        session.handle(text, answers.append)
        (answer,) = [event for event in answers if event["event"] in seen]
        seen[answer["event"]] += 1
        said = answer.get("message", "-")
        assert said, text
        assert len(said.splitlines()) == 1, text
        assert len(said) < LONGEST, text
        if sequence % 200 == 199:
            session.close(keep=False)
            session = Session(diagram(), folder=tmp_path, states=states)
    assert min(seen.values()) > count / 40
    client = Client(session, "after")
    client.do("open", text=timlab.dumps(diagram()))
    client.do("connect", at=[], source="sine", target="gain")
    session.close(keep=False)
    assert all(path.suffix in (".json", ".journal") for path in tmp_path.iterdir() if path != states)
