"""What goes wrong in a run: numbers that are not finite are named; a long compilation is said and can be stopped."""

import dataclasses
import itertools
import re
import signal
import subprocess
import sys
import threading
import time
from collections import defaultdict
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from editor_clients import Client

import timlab
from motorgrad.schema import static
from timlab.blocks._scopes import Raster
from timlab.editor import Session, _compilation
from timlab.editor._warnings import warnings


@pytest.fixture
def open_client(tmp_path):
    """A client of a session on a diagram, which is closed in the end."""
    opened = []

    def start(diagram):
        opened.append(Session(diagram, folder=tmp_path, states=tmp_path / "states"))
        return Client(opened[-1])

    yield start
    for session in opened:
        session.close()


def chain(*blocks, tick=0.01):
    """Blocks in a row, named by their types."""
    diagram = timlab.Diagram(tick)
    for block in blocks:
        diagram.add(block.name, block)
    for source, target in itertools.pairwise(blocks):
        diagram.connect(source.name, f"{target.name}.{next(iter(target.inputs))}")
    return diagram


def test_a_number_that_is_not_finite_stops_the_run_and_is_named(open_client):
    falling = timlab.Ramp(-1.0, initial=0.055)  # below 0, where there is no square root, from tick 6 on
    client = open_client(chain(falling, timlab.Function("sqrt"), timlab.Scope()))
    client.do("tick", n=6)
    assert client.run()["faults"] == []
    client.do("tick", n=20)
    began = "becomes NaN at tick 6 (0.06 s). It begins here: its input u = -0.005. Keep its inputs where it is defined"
    assert client.run()["faults"] == [{"path": "function", "port": "y", "message": began}]
    assert (client.run()["state"], client.run()["tick"], client.run()["head"]) == ("paused", 6, 6)
    assert client.last("error")["message"] == f'function.y: {began}; on_fault="warn" goes on without it'
    rows = [row for event in client.seen if event["event"] == "samples" for row in _rows(event)]
    assert len(rows) == 6
    client.do("parameter", address="ramp.initial", value=1.0)
    client.do("tick", n=5)  # past it
    assert (client.run()["faults"], client.run()["tick"]) == ([], 11)


def _rows(event):
    return event["signals"].get("scope.u", {"rows": []})["rows"]


def test_of_many_ticks_and_seeds_the_first_is_found(open_client):
    diagram = chain(
        timlab.UniformNoise(low=0.0), timlab.Gain(1.0), timlab.Function("log"), timlab.Integrator(), timlab.Scope()
    )
    client = open_client(diagram)
    client.do("seeds", n=3)
    client.do("tick", n=2000)
    assert client.run()["faults"] == []
    client.do("parameter", address="gain.gain", value=-1.0)
    client.do("tick", n=1500)
    (began,) = client.run()["faults"]
    assert (began["path"], began["port"]) == ("function", "y")
    given = timlab.Run(chain(timlab.UniformNoise(low=0.0), timlab.Gain(-1.0)), 3, watch=["gain.y"]).advance(2001)[
        "gain.y"
    ][0, -1]
    assert began["message"].startswith(
        f"becomes NaN at tick 2000 (20 s) in seed 0. It begins here: its input u = {given:.4g}"
    )


def test_who_goes_on_knowingly_is_warned_once(open_client):
    diagram = chain(timlab.Ramp(-1.0, initial=0.055), timlab.Function("sqrt"), timlab.Scope())
    diagram.on_fault = "warn"
    client = open_client(diagram)
    client.do("tick", n=20)
    client.do("tick", n=5)
    assert (client.run()["tick"], [fault["path"] for fault in client.run()["faults"]]) == (25, ["function"])
    assert sum(event["event"] == "error" for event in client.seen) == 1
    client.do("reset")
    assert client.run()["faults"] == []


def test_a_diagram_that_chatters_can_be_paused_and_left(open_client):
    """It froze the page: a relay of a comparison and a switch, whose state stays at 0."""
    diagram = timlab.Diagram(0.1, solver="tsit5")
    blocks = {
        "x": timlab.Integrator(0.25),
        "over": timlab.Compare(">="),
        "down": timlab.Constant(-1.0),
        "up": timlab.Constant(1.0),
    }
    for name, block in {**blocks, "rate": timlab.Switch(), "scope": timlab.Scope()}.items():
        diagram.add(name, block)
    for wire in ("x over.u1", "over rate.condition", "down rate.on", "up rate.off", "rate x", "x scope"):
        diagram.connect(*wire.split())
    client = open_client(diagram)
    client.do("play")
    client.until(lambda event: event["event"] == "run" and event.get("faults"))
    client.do("pause")
    (fault,) = client.run()["faults"]
    assert (fault["path"], fault["message"][:21]) == ("over", "chatters from tick 2 ")
    rows = [row[0] for event in client.seen if event["event"] == "samples" for row in _rows(event)]
    assert max(map(abs, rows[3:])) < 0.002  # two hundredths of the tick
    client.do("open", text=timlab.dumps(chain(timlab.Sine(), timlab.Scope())))
    client.until(lambda event: event["event"] == "run" and event["state"] == "empty" and event["faults"] == [])


def test_what_is_faster_than_the_tick_is_warned_of():
    made = {
        "fast": timlab.Lag(0.001),
        "quick": timlab.Lag(0.009),
        "slow": timlab.Lag(0.1),
        "discrete": timlab.DiscreteLag(0.002),
    }
    made |= {
        "filter": timlab.TransferFunction((1.0,), (1.0, 2.0, 500.0**2)),
        "pid": timlab.PID(derivative_gain=1.0, filter=0.001),
    }
    diagram = timlab.Diagram(0.01)
    for name, block in made.items():
        diagram.add(name, block)
        diagram.add(f"{name} in", timlab.Constant(1.0))
        diagram.connect(f"{name} in", f"{name}.{next(iter(block.inputs))}")
    found = {path: message for path, _, message in warnings(diagram)}
    assert set(found) == {"fast", "quick", "discrete", "filter", "pid"}
    assert found["fast"].startswith("is faster than the tick: its shortest time constant, 0.001 s, is below the")
    assert {name for name in found if "unstable" in found[name]} == {"fast", "filter", "pid"}
    diagram.substeps = 20
    assert {path for path, *_ in warnings(diagram)} == {"discrete"}


def test_a_branch_keeps_what_was_found_in_it(open_client):
    client = open_client(chain(timlab.Ramp(-1.0, initial=0.055), timlab.Function("sqrt"), timlab.Scope()))
    client.do("tick", n=10)
    client.do("fork", branch="main", tick=2, name="other")
    assert client.run()["faults"] == []
    client.do("parameter", address="ramp.slope", value=1.0)
    client.do("tick", n=10)
    assert client.run()["faults"] == []
    client.do("scrub", branch="main", tick=3)
    assert [fault["path"] for fault in client.run()["faults"]] == ["function"]


def test_a_raster_does_not_draw_nan_as_an_event():
    record = timlab.Record(0, 3, 0.1, {"raster.u": np.array([[[np.nan], [0.0], [1.0]]])}, {"raster.u": 1})
    (events,) = Raster().figure(record, "raster").axes[0].collections
    np.testing.assert_allclose(events.get_positions(), [0.2])


RELEASED: dict[int, threading.Event] = defaultdict(threading.Event)  # by the number of a block, until it is compiled
ENDED: set[int] = set()  # numbers of blocks whose compilation waits no more
NUMBERS = itertools.count()


@dataclasses.dataclass(frozen=True)
class Slow(timlab.Block):
    """A block whose compilation waits, as it would for a program that is too large."""

    name: ClassVar[str] = "slow"
    category: ClassVar[str] = "tests"
    number: int = static(factory=NUMBERS.__next__, help="each is another program")

    @property
    def outputs(self):
        return {"y": timlab.Port()}

    def init(self, uniforms):
        if isinstance(uniforms, jax.core.Tracer) and threading.current_thread().name == "motorgrad-lab-compiler":
            RELEASED[self.number].wait(600)
            ENDED.add(self.number)
        return jnp.zeros(())

    def output(self, state, inputs, now):
        return {"y": state}


@pytest.fixture
def block():
    """A block whose compilation waits until the test releases it, or ends."""
    block = Slow()
    yield block
    RELEASED[block.number].set()


@pytest.fixture
def slow(open_client, block):
    return open_client(chain(block, timlab.Scope()))


def start(client, op="play", **fields):
    """Send an operation without waiting. **Returns** its number."""
    client.session.handle(client.message(op, **fields), client.inbox.put)
    client.until(lambda event: event["event"] == "run" and event["state"] == "compiling")
    return client.sequence


def test_a_compilation_can_be_stopped_and_the_session_goes_on(slow, block):
    sequence = start(slow)
    slow.do("add", at=[], type="gain")  # the session answers meanwhile
    slow.do("pause")
    assert block.number not in ENDED
    refused = next(event for event in slow.seen if event["event"] == "refused")
    assert refused["sequence"] == sequence
    assert re.match(r"compilation stopped after \d+ s", refused["message"])
    assert slow.run()["state"] == "empty"
    slow.do("open", text=timlab.dumps(chain(timlab.Sine(), timlab.Scope())))
    slow.do("tick", n=3)  # another diagram runs while the compiler still works on the first
    assert slow.run()["tick"] == 3


def test_opening_another_diagram_does_not_wait_for_the_compiler(slow):
    start(slow)
    slow.do("open", gallery="chain")
    slow.until(lambda event: event["event"] == "refused")
    slow.until(lambda event: event["event"] == "run" and event["state"] == "empty")


def test_what_was_running_is_there_after_a_stop(open_client, block):
    client = open_client(chain(timlab.Sine(), timlab.Scope()))
    client.do("tick", n=7)
    before = client.log()
    client.do("add", at=[], type="gain")
    client.session._runner._tree.diagram = chain(block, timlab.Scope())
    client.session._runner._tree.stale = True
    start(client)
    client.do("pause")
    assert (client.run()["tick"], client.log()) == (7, before)


def test_stopped_compilations_do_not_pile_up(slow, block):
    for _ in range(2):
        start(slow)
        slow.do("pause")
    refused = slow.ask("play")
    assert refused["event"] == "refused"
    assert refused["message"].startswith("compilations that were stopped and still go on = 2: must be at most 1")
    RELEASED[block.number].set()
    end = time.monotonic() + 600
    while slow.ask("play")["event"] == "refused" and time.monotonic() < end:
        time.sleep(0.05)
    slow.do("pause")
    assert slow.run()["state"] == "paused"


def test_a_long_compilation_is_said(slow, monkeypatch):
    monkeypatch.setattr(_compilation, "PATIENCE", 0.2)
    monkeypatch.setattr(_compilation, "REPORT", 0.05)
    start(slow)
    slow.until(lambda event: event["event"] == "error" and event["message"].endswith("so far: pause stops it"))
    slow.until(lambda event: event["event"] == "run" and (event["waited"] or 0) > 0.2)
    slow.do("pause")


def test_closing_a_session_does_not_wait_for_the_compiler(tmp_path, block):
    session = Session(chain(block, timlab.Scope()), folder=tmp_path, states=tmp_path / "states")
    start(Client(session))
    session.close()
    assert block.number not in ENDED


STOPPED = """
import sys, threading
sys.path[:0] = {path!r}
import timlab
from test_lab_editor_faults import RELEASED, Client, Session, Slow, chain, start
block = Slow()
client = Client(Session(chain(block, timlab.Scope())))
start(client)
client.do("pause")
print("stopped", flush=True)
threading.Thread(target=lambda: sys.stdin.readline() and RELEASED[block.number].set(), daemon=True).start()
client.session.close()
sys.exit(7)
"""


@pytest.mark.ci
@pytest.mark.parametrize("interrupted", [False, True])
def test_a_process_waits_for_the_compiler_at_its_end_unless_interrupted(interrupted, tmp_path, process_environment):
    code = STOPPED.format(path=sys.path)
    process = subprocess.Popen(
        [sys.executable, "-c", code],
        cwd=tmp_path,
        env=process_environment,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    assert process.stderr is not None
    assert process.stdout.readline() == "stopped\n"
    assert process.stderr.readline() == "waiting for the compiler to end; Ctrl-C ends at once\n"
    if interrupted:
        process.send_signal(signal.SIGINT)
    else:
        process.stdin.write("release\n")
        process.stdin.flush()
    assert process.wait(600) == (130 if interrupted else 7)
    process.communicate()


@dataclasses.dataclass(frozen=True)
class Doubling(timlab.Block):
    """A state that doubles until it is infinite. A search for the culprit waits at it, as in a large diagram."""

    name: ClassVar[str] = "doubling"
    category: ClassVar[str] = "tests"
    number: int = static(factory=NUMBERS.__next__, help="each is another program")
    compiled: ClassVar[set[int]] = set()
    found: ClassVar[dict[int, threading.Event]] = defaultdict(threading.Event)

    @property
    def outputs(self):
        return {"y": timlab.Port()}

    def init(self, uniforms):
        return jnp.ones(())

    def output(self, state, inputs, now):
        if self.number in self.compiled:  # what looks at it now is the search
            self.compiled.remove(self.number)
            self.found[self.number].set()
            RELEASED[self.number].wait(600)
            ENDED.add(self.number)
        return {"y": state}

    def update(self, state, inputs, now):
        return 2 * state


@pytest.mark.parametrize("op", ["pause", "reset", "open", "close"])
def test_a_search_for_the_culprit_ends_at_once(op, open_client):
    block = Doubling()
    client = open_client(chain(block, timlab.Scope()))
    client.do("tick", n=100)
    block.compiled.add(block.number)
    client.session.handle(client.message("tick", n=100), client.inbox.put)  # 2 ** 128 is infinite
    assert block.found[block.number].wait(600)
    try:
        client.do("add", at=[], type="sine")  # the page answers meanwhile
        if op == "close":
            client.session.close()
        else:
            client.do(op, **({"text": timlab.dumps(chain(timlab.Sine(), timlab.Scope()))} if op == "open" else {}))
        assert block.number not in ENDED
        if op == "pause":
            assert (client.run()["state"], client.run()["faults"]) == ("paused", [])
            assert 100 <= client.run()["tick"] < 128  # before what went wrong
            assert re.match(r"the search for what went wrong stopped after \d+ s", client.last("error")["message"])
    finally:
        RELEASED[block.number].set()
    if op == "pause":
        client.do("tick", n=100)  # it searches again, and finds
        assert [fault["path"] for fault in client.run()["faults"]] == ["doubling"]
    elif op == "open":
        client.do("tick", n=3)
        assert client.run()["tick"] == 3
