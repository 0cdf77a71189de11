"""Functional Mock-up Units as blocks: units of our own C, run by fmpy."""

import hashlib
import json
import pickle
import re
import shutil
import sys
import threading
import zipfile
from typing import Any

import numpy as np
import pytest
from units import built, needs_compiler

import timlab
from motorgrad._errors import NotTrusted
from timlab import Diagram, DiagramError, Fmu, Run
from timlab.diagram import HostMoment
from timlab.editor import Session

pytestmark = [needs_compiler, pytest.mark.needs("motorgrad[fmi]")]
TICK = 0.05


@pytest.fixture(scope="module")
def balls(tmp_path_factory):
    return {version: str(built(tmp_path_factory.mktemp("unit"), version)) for version in ("2.0", "3.0")}


def diagram(file, **settings):
    """A ball, thrown by noise."""
    made = Diagram(tick=TICK)
    made.add("noise", timlab.UniformNoise(low=0.0, high=8.0))
    made.add("ball", Fmu(file, **settings))
    made.connect("noise", "ball.u")
    return made


WATCHED = ("ball.ball_h", "ball.v", "ball.bounces", "noise.y")
CASES = [("2.0", "co-simulation"), ("2.0", "model exchange"), ("3.0", "")]


def exact(throws, e=0.5):
    """Height, velocity and bounces of the ball at each tick, in closed form between bounces."""
    h, v, count, rows = 1.0, 0.0, 0, []
    for u in throws:
        rows.append((h, v, count))
        left, a = TICK, u - 9.81
        while True:
            roots = np.roots([a / 2, v, h])
            roots = [r.real for r in roots if abs(r.imag) < 1e-12 and 1e-12 < r.real <= left and v + a * r.real < 0]
            if not roots:
                h, v = h + v * left + a / 2 * left**2, v + a * left
                break
            hit = min(roots)
            h, v, left, count = 0.0, -e * (v + a * hit), left - hit, count + 1
    return np.array(rows).T


@pytest.mark.parametrize(("version", "interface"), CASES)
def test_a_unit_moves_as_its_equations_do(version, interface, balls):
    run = Run(diagram(balls[version], interface=interface, start_values="e = 0.8"), seeds=2, watch=WATCHED)
    record = run.advance(30)
    for seed in range(2):
        h, v, count = exact(record["noise.y"][seed].astype(float), 0.8)
        near = {"rtol": 1e-4, "atol": 5e-3} if interface == "co-simulation" else {"rtol": 1e-5, "atol": 1e-5}
        np.testing.assert_array_equal(record["ball.bounces"][seed], count)
        np.testing.assert_allclose(record["ball.ball_h"][seed], h, **near)
        np.testing.assert_allclose(record["ball.v"][seed], v, **near)
    assert count[-1] >= 1
    assert not np.array_equal(*record["ball.v"])


@pytest.mark.parametrize(("version", "interface"), CASES)
def test_going_back_is_exact(version, interface, balls):
    run = Run(diagram(balls[version], interface=interface), seeds=2, watch=WATCHED)
    run.advance(13)
    state = run.state
    first = run.advance(20)
    run.restore(state)
    again = run.advance(20)
    other = run.fork()
    other.restore(state)
    for name in WATCHED:
        np.testing.assert_array_equal(again[name], first[name])
    np.testing.assert_array_equal(other.advance(20)["ball.v"], first["ball.v"])
    other.close()
    run.close()


def test_ports_come_from_the_description(balls):
    block = Fmu(balls["2.0"])
    assert list(block.inputs) == ["u"]
    assert {name: port.kind for name, port in block.outputs.items()} == {
        "ball_h": "float",
        "v": "float",
        "bounces": "int",
    }
    assert block.outputs["ball_h"].help == "height"


def test_a_unit_that_cannot_save_its_state_says_so(tmp_path):
    run = Run(diagram(str(built(tmp_path, "2.0", saves=False))))
    assert run.no_restore == {"ball": "the unit ball2.fmu cannot save its state"}
    run.advance(2)
    with pytest.raises(ValueError, match=r"ball: cannot be saved: the unit ball2.fmu cannot save its state"):
        _ = run.state


@pytest.mark.parametrize("name", ["/somewhere/evil", "../../../evil", "..\\\\evil", ""])
def test_a_unit_names_no_library_outside_of_it(name, balls, tmp_path):
    unit = tmp_path / "unit.fmu"
    with zipfile.ZipFile(balls["2.0"]) as given, zipfile.ZipFile(unit, "w") as archive:
        about = given.read("modelDescription.xml").decode()
        archive.writestr("modelDescription.xml", re.sub('modelIdentifier="[^"]*"', f'modelIdentifier="{name}"', about))
    with pytest.raises(
        ValueError, match=r"modelIdentifier of the unit = .*: must be the name of a library in the unit"
    ):
        Fmu(str(unit))


def changed(file, into, note):
    """A copy of a unit with other content."""
    shutil.copy(file, into)
    with zipfile.ZipFile(into, "a") as archive:
        archive.writestr("resources/note.txt", note)
    return into


def test_a_strangers_unit_does_not_run_unasked(balls, tmp_path):
    unit = changed(balls["2.0"], tmp_path / "stranger.fmu", "a stranger's")
    text = timlab.dumps(diagram(balls["2.0"])).replace(balls["2.0"], str(unit))
    opened = timlab.loads(text)
    with pytest.raises(DiagramError, match=r"ball: .* nothing of it was run.*--trust"):
        Run(opened)
    sent = pickle.loads(pickle.dumps(opened.nodes["ball"].block))
    assert not sent.is_trusted
    Run(timlab.loads(text, trust=True)).advance(1)
    assert sent.is_trusted  # for its content, which is found elsewhere, too
    Run(timlab.loads(text.replace(str(unit), str(unit.rename(tmp_path / "moved.fmu"))))).advance(1)


def test_a_unit_that_is_exchanged_is_asked_for_again(balls, tmp_path):
    unit = changed(balls["2.0"], tmp_path / "unit.fmu", "the first")
    text = timlab.dumps(diagram(balls["2.0"])).replace(balls["2.0"], str(unit))
    trusted = timlab.loads(text, trust=True)
    Run(trusted).advance(1)
    changed(balls["2.0"], unit, "the second")
    refusal = "unit.fmu is not the unit that was read when this block was made: nothing of it was run"
    with pytest.raises(NotTrusted, match=refusal):
        Run(trusted).advance(1)
    with pytest.raises(DiagramError, match=r"ball: .* nothing of it was run.*--trust"):
        Run(timlab.loads(text))
    again = timlab.loads(text, trust=True)
    Run(again).advance(1)  # not with the block that was compiled for the first
    with pytest.raises(NotTrusted, match=refusal):
        Run(trusted).advance(1)


def test_another_setting_does_not_trust_a_unit_that_was_exchanged(balls, tmp_path):
    """Nor in a notebook, where what a user makes is the user's own."""
    unit = changed(balls["2.0"], tmp_path / "unit.fmu", "trusted")
    text = timlab.dumps(diagram(balls["2.0"])).replace(balls["2.0"], str(unit))
    block: Any = timlab.loads(text, trust=True).nodes["ball"].block
    assert block.retuned({"substeps": 20}).is_trusted
    changed(balls["2.0"], unit, "exchanged before the setting was changed")
    assert not block.retuned({"substeps": 20}).is_trusted
    timlab.loads(text)
    assert not block.retuned({"substeps": 20}).is_trusted


def test_the_page_asks_again_for_a_unit_that_is_exchanged(balls, tmp_path):
    unit = changed(balls["2.0"], tmp_path / "unit.fmu", "on the page")
    text = timlab.dumps(diagram(balls["2.0"])).replace(balls["2.0"], str(unit))
    (tmp_path / "page.json").write_text(text)
    session = Session(file=tmp_path / "page.json", states=tmp_path / "states")
    numbers = iter(range(100))

    def ask(**operation):
        found, answers = threading.Event(), []

        def answer(event):
            answers.append(event)
            found.set()

        session.handle(json.dumps(operation | {"client": "page", "sequence": next(numbers)}), answer)
        assert found.wait(600)
        return answers[-1]

    def offers():
        return session._offers.of(session.diagram)

    (told,) = offers()
    assert told["offered"]
    assert told["code"] == f"{unit}\nSHA-256 {hashlib.sha256(unit.read_bytes()).hexdigest()}"
    changed(balls["2.0"], unit, "exchanged while it was read")
    assert ask(op="trust", keys=[told["key"]])["event"] == "done"
    assert "is not the unit that was read" in ask(op="tick", n=1)["message"]
    # whatever makes the block again from the exchanged file
    assert ask(op="set", at=[], name="ball", fields={}, field="substeps", value=20)["event"] == "done"
    assert [each["offered"] for each in offers()] == [False]
    assert ask(op="open", file="page.json")["event"] == "done"
    (told,) = offers()
    assert told["offered"]
    assert ask(op="trust", keys=[told["key"]])["event"] == "done"
    assert ask(op="tick", n=1)["event"] == "done"
    session.close()


def test_a_missing_package_is_named(balls, monkeypatch):
    monkeypatch.setitem(sys.modules, "fmpy", None)  # an import of it fails
    with pytest.raises(ValueError, match=r"need the package fmpy: pip install 'motorgrad\[fmi\]'"):
        Fmu(balls["2.0"])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"file": "ball.zip"}, "must be a path of a file that ends in .fmu"),
        ({"start_values": "mass = 1.0"}, "unknown variable of the unit 'mass'"),
        ({"interface": "co-simulation"}, "known are model exchange"),
        ({"substeps": 0}, "substeps = 0: must be an integer from 1"),
    ],
)
def test_bad_settings_are_named(settings, message, balls):
    with pytest.raises(ValueError, match=message):
        Fmu(**{"file": balls["3.0"], **settings})


def test_a_refusal_of_the_unit_names_it_and_the_time(balls):
    # the ball refuses an input that is no finite number, as the logarithm is from the fourth tick on
    made = Diagram(tick=TICK)
    made.add("ramp", timlab.Ramp())
    made.add("log", timlab.Expression("log(0.12 - t)", ("t",)))
    made.add("ball", Fmu(balls["2.0"]))
    made.connect("ramp", "log.t")
    made.connect("log", "ball.u")
    message = r"the unit ball at 0\.15 s: fmi2SetReal failed with status 3 \(error\)\."
    with pytest.raises(RuntimeError, match=message):
        Run(made).advance(10)


REFUSES = {  # a call that the unit lacks returns the status of an error
    "fmi2EnterInitializationMode": ("co-simulation", (" fmi2EnterInitializationMode(", " other(")),
    "fmi2DoStep": ("co-simulation", (" fmi2DoStep(", " other(")),
    "fmi2GetReal": ("co-simulation", (" fmi2GetReal(", " other(")),
    "fmi2GetDerivatives": ("model exchange", (" fmi2GetDerivatives(", " other(")),
    "fmi2NewDiscreteStates": ("model exchange", (" fmi2NewDiscreteStates(", " other(")),
}


@pytest.mark.parametrize("call", REFUSES)
def test_every_call_that_is_refused_is_named_with_its_status(call, tmp_path):
    interface, change = REFUSES[call]
    block = Fmu(str(built(tmp_path, "2.0", change=change)), interface=interface)
    message = rf"^the unit ball at 0 s: {call} failed with status 3 \(error\)\.$"
    with pytest.raises(RuntimeError, match=message):
        stepped(block)


SETTLES = "*a = *t = *n = *v = *d = 0;"
ENDS = {
    "*t = 1;": "it asks to end the simulation",
    "*a = 1;": "its discrete states still change after 1000 updates",
}


@pytest.mark.parametrize("flag", ENDS)
def test_a_unit_that_ends_or_never_settles_is_refused(flag, tmp_path):
    block = Fmu(str(built(tmp_path, "3.0", change=(SETTLES, f"{SETTLES} {flag}"))))
    with pytest.raises(RuntimeError, match=f"^the unit ball at 0 s: {ENDS[flag]}$"):
        stepped(block)


def stepped(block):
    """The unit of a block after a step."""
    host = block.start(np.arange(1), np.zeros((1, 0)))
    try:
        host.update(block, {"u": np.zeros(1)}, HostMoment(0, 0.0, TICK, np.zeros((1, 0))))
    finally:
        host.close()
