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
from typing import Annotated, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from editor_clients import Client

from motorgrad import lab
from motorgrad.lab.blocks._scopes import Raster
from motorgrad.lab.editor import Session, _compilation
from motorgrad.lab.editor._warnings import warnings


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
    diagram = lab.Diagram(tick)
    for block in blocks:
        diagram.add(block.name, block)
    for source, target in itertools.pairwise(blocks):
        diagram.connect(source.name, f"{target.name}.{next(iter(target.inputs))}")
    return diagram


def test_a_signal_that_turns_nan_is_named_with_its_first_tick(open_client):
    falling = lab.Ramp(-1.0, initial=0.055)  # below 0, where there is no square root, from tick 6 on
    client = open_client(chain(falling, lab.Function("sqrt"), lab.Scope()))
    client.do("tick", n=6)
    assert client.run()["faults"] == []
    client.do("tick", n=20)
    began = "becomes NaN at tick 6 (0.06 s). It begins here: its input u = -0.005"
    assert client.run()["faults"] == [
        {"path": "function", "port": "y", "message": began},
        {"path": "scope", "port": "u", "message": "is NaN at tick 6 (0.06 s)"},
    ]
    assert client.last("error")["message"] == f"function.y: {began}"
    rows = [row for event in client.seen if event["event"] == "samples" for row in _rows(event)]
    assert len(rows) == 26
    assert all((row[0] is None) == (tick >= 6) for tick, row in enumerate(rows))  # nothing stands for it
    client.do("tick", n=5)
    assert sum(event["event"] == "error" for event in client.seen) == 1  # said once
    client.do("reset")
    assert client.run()["faults"] == []


def _rows(event):
    return event["signals"].get("scope.u", {"rows": []})["rows"]


@pytest.mark.slow
def test_a_state_that_nobody_records_is_named_too(open_client):
    client = open_client(chain(lab.Constant(3e38), lab.Gain(3e38), lab.Integrator()))
    client.do("tick", n=3)
    began, fault = client.run()["faults"]
    assert (began["path"], began["port"]) == ("gain", "y")
    assert began["message"] == "becomes infinite at tick 0 (0 s). It begins here: its input u = 3e+38"
    assert (fault["path"], fault["port"]) == ("integrator", None)
    assert fault["message"] == "its state is NaN or infinite at tick 3 (0.03 s)"


@pytest.mark.slow
def test_where_it_began_is_found_among_many_ticks_seeds_and_changes(open_client):
    diagram = chain(lab.UniformNoise(low=0.0), lab.Gain(1.0), lab.Function("log"), lab.Integrator(), lab.Scope())
    client = open_client(diagram)
    client.do("seeds", n=3)
    client.do("tick", n=2000)
    assert client.run()["faults"] == []
    client.do("parameter", address="gain.gain", value=-1.0)
    client.do("tick", n=1500)
    began, *others = client.run()["faults"]
    assert (began["path"], began["port"]) == ("function", "y")
    run = lab.Run(client.session.diagram, 3, watch=["gain.y"])
    given = run.advance(2001)["gain.y"][0, -1]
    assert began["message"] == f"becomes NaN at tick 2000 (20 s) in seed 0. It begins here: its input u = {given:.4g}"
    assert [each["path"] for each in others] == ["scope", "integrator"]


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore:lag.* RK4 steps of")
def test_a_state_that_grows_without_bound_is_where_it_began(open_client):
    client = open_client(chain(lab.Constant(1.0), lab.Lag(0.001), lab.Gain(2.0), lab.Scope()))
    client.do("tick", n=300)
    began = client.run()["faults"][0]
    assert (began["path"], began["port"]) == ("lag", None)
    assert re.fullmatch(
        r"its state becomes (NaN|infinite) at tick 1\d .*: its input u = 1\. lag: RK4 steps of 0\.01 s are unstable.*",
        began["message"],
    )


def test_what_is_faster_than_the_tick_is_warned_of():
    made = {"fast": lab.Lag(0.001), "quick": lab.Lag(0.009), "slow": lab.Lag(0.1), "discrete": lab.DiscreteLag(0.002)}
    made |= {
        "filter": lab.TransferFunction((1.0,), (1.0, 2.0, 500.0**2)),
        "pid": lab.PID(derivative_gain=1.0, filter=0.001),
    }
    diagram = lab.Diagram(0.01)
    for name, block in made.items():
        diagram.add(name, block)
        diagram.add(f"{name} in", lab.Constant(1.0))
        diagram.connect(f"{name} in", f"{name}.{next(iter(block.inputs))}")
    found = {path: message for path, _, message in warnings(diagram)}
    assert set(found) == {"fast", "quick", "discrete", "filter", "pid"}
    assert found["fast"].startswith("is faster than the tick: its shortest time constant, 0.001 s, is below the")
    assert {name for name in found if "unstable" in found[name]} == {"fast", "filter", "pid"}
    diagram.substeps = 20
    assert {path for path, *_ in warnings(diagram)} == {"discrete"}


@pytest.mark.ci
def test_of_many_seeds_it_is_said_how_many(open_client):
    client = open_client(chain(lab.UniformNoise(), lab.Function("log"), lab.Scope()))
    client.do("seeds", n=20)
    client.do("tick", n=4)
    negative = np.isnan(lab.Run(client.session.diagram, 20).advance(1)["scope.u"][:, 0]).sum()
    assert 0 < negative < 20
    began, fault = client.run()["faults"]
    assert began["path"] == "function"
    assert fault["message"] == f"is NaN at tick 0 (0 s) in {negative} of 20 seeds"


def test_a_branch_keeps_what_was_found_in_it(open_client):
    client = open_client(chain(lab.Ramp(-1.0, initial=0.055), lab.Function("sqrt"), lab.Scope()))
    client.do("tick", n=10)
    client.do("fork", branch="main", tick=2, name="other")
    assert client.run()["faults"] == []
    client.do("parameter", address="ramp.slope", value=1.0)
    client.do("tick", n=10)
    assert client.run()["faults"] == []
    client.do("scrub", branch="main", tick=3)
    assert [fault["path"] for fault in client.run()["faults"]] == ["function", "scope"]


def test_a_raster_does_not_draw_nan_as_an_event():
    record = lab.Record(0, 3, 0.1, {"raster.u": np.array([[[np.nan], [0.0], [1.0]]])}, {"raster.u": 1})
    (events,) = Raster().figure(record, "raster").axes[0].collections
    np.testing.assert_allclose(events.get_positions(), [0.2])


RELEASED: dict[int, threading.Event] = defaultdict(threading.Event)  # by the number of a block, until it is compiled
ENDED: set[int] = set()  # numbers of blocks whose compilation waits no more
NUMBERS = itertools.count()


@dataclasses.dataclass(frozen=True)
class Slow(lab.Block):
    """A block whose compilation waits, as it would for a program that is too large."""

    name: ClassVar[str] = "slow"
    category: ClassVar[str] = "tests"
    number: Annotated[int, lab.Setting("each is another program")] = dataclasses.field(default_factory=NUMBERS.__next__)

    @property
    def outputs(self):
        return {"y": lab.Port()}

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
    return open_client(chain(block, lab.Scope()))


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
    slow.do("open", text=lab.dumps(chain(lab.Sine(), lab.Scope())))
    slow.do("tick", n=3)  # another diagram runs while the compiler still works on the first
    assert slow.run()["tick"] == 3


def test_opening_another_diagram_does_not_wait_for_the_compiler(slow):
    start(slow)
    slow.do("open", gallery="chain")
    slow.until(lambda event: event["event"] == "refused")
    slow.until(lambda event: event["event"] == "run" and event["state"] == "empty")


def test_what_was_running_is_there_after_a_stop(open_client, block):
    client = open_client(chain(lab.Sine(), lab.Scope()))
    client.do("tick", n=7)
    before = client.log()
    client.do("add", at=[], type="gain")
    client.session._runner._tree.diagram = chain(block, lab.Scope())
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
    session = Session(chain(block, lab.Scope()), folder=tmp_path, states=tmp_path / "states")
    start(Client(session))
    session.close()
    assert block.number not in ENDED


STOPPED = """
import sys, threading
sys.path[:0] = {path!r}
from test_lab_editor_faults import RELEASED, Client, Session, Slow, chain, lab, start
block = Slow()
client = Client(Session(chain(block, lab.Scope())))
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
