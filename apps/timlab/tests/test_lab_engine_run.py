"""Diagrams in motion: retuning, ensembles, random streams, saving, forking, adopting."""

import dataclasses
from typing import ClassVar

import numpy as np
import pytest

from lab_examples import Adding, Chance, Dice, Ticker, leak, same, wire
from timlab import Constant, Diagram, Gain, Integrator, Interpreter, Outlet, Run, UnitDelay, join
from timlab.compiler import _program, plan


def mixed() -> Diagram:
    """Chance, memory, rates and continuous motion in one diagram."""
    diagram = Diagram(tick=0.1, title="mixed")
    diagram.add("dice", Dice())
    diagram.add("slow", UnitDelay(0.5, (2,), every=3))
    diagram.add("gain", Gain(0.7))
    diagram.add("leak", leak())
    diagram.add("level", Outlet())
    diagram.add("slow seen", Outlet((2,), every=4))
    diagram.connect("slow", "slow seen")
    return wire(diagram, "dice.y slow", "dice.start gain", "gain leak", "leak level")


def hosted() -> Diagram:
    diagram = Diagram()
    diagram.add("host", Ticker(0.3, every=2))
    diagram.add("dice", Chance())
    diagram.add("level", Outlet((2,)))
    return wire(diagram, "dice host", "host level")


def test_retuning_does_not_compile_again():
    run = Run(mixed(), seeds=2)
    for value in (0.1, 3.0, 7):
        run["gain.gain"] = value
        run["leak/rate.gain"] = value
        run.advance(5)
    run.advance(40)
    assert run["gain.gain"] == 7.0
    assert run.compilations == 1
    run["gain.gain"] = 0.0
    run["leak/rate.gain"] = 10.0
    assert np.all(np.abs(run.advance(40)["level.u"][:, -1]) < 1e-3)


@pytest.mark.parametrize("make", [mixed, pytest.param(hosted, marks=pytest.mark.ci)])
def test_compiling_ahead_changes_nothing_and_is_done_once(make):
    _program._kept.clear()
    at_once, ahead = Run(make(), 2), Run(make(), 2)
    ahead.compile()
    same(ahead.state, at_once.state)
    compiled = ahead.compilations
    record = ahead.advance(20)
    assert ahead.compilations == compiled == 1
    same(record.signals, at_once.advance(20).signals)
    same(ahead.state, at_once.state)


@pytest.mark.parametrize(
    ("address", "value", "says"),
    [
        ("gain.gain", "2", r"gain\.gain = '2': must be a finite number"),
        ("gain.gain", float("nan"), r"gain\.gain = nan: must be a finite number"),
        ("gain.gain", [1.0, 2.0], r"gain\.gain: shape = \(2,\): must be one that broadcasts to \(\)"),
        ("gain.gian", 1.0, "unknown parameter of gain: 'gian': did you mean 'gain'"),
        ("gian.gain", 1.0, "unknown block 'gian': did you mean 'gain'"),
        ("gain", 1.0, "unknown block 'gain'"),
    ],
)
def test_impossible_values_are_refused_and_change_nothing(address, value, says):
    run = Run(mixed())
    with pytest.raises(ValueError, match=says):
        run[address] = value
    assert run["gain.gain"] == 0.7


def test_a_parameter_keeps_its_shape_while_it_runs():
    diagram = Diagram()
    diagram.add("three", Constant(1.0, (3,)))
    run = Run(diagram, watch=["three.y"])
    with pytest.raises(ValueError, match=r"three\.value: shape = \(3,\): must be \(\), as it was"):
        run["three.value"] = [1.0, 2.0, 3.0]


@pytest.mark.ci
def test_a_thousand_seeds_are_a_thousand_rows_and_the_same_again():
    one, other = (Run(mixed(), seeds=1000).advance(9) for _ in range(2))
    for address in ("level.u", "slow seen.u"):
        np.testing.assert_array_equal(one[address], other[address])
    rows = one["level.u"].reshape(1000, -1)
    assert len(np.unique(rows[:, -1])) == 1000
    few = Run(mixed(), seeds=[999, 3]).advance(9)["level.u"]
    np.testing.assert_allclose(few, rows[[999, 3]], 1e-6)


def among_others():
    """The mixed diagram with its dice under another name, among further ones."""
    diagram = mixed()
    more = Diagram()
    more.add("more dice", Dice())
    for name, block in [("a die", Dice()), ("inner", more), ("three", Dice(3))]:
        diagram.add(name, block)
    diagram.nodes = dict(reversed(diagram.nodes.items()))
    diagram.rename("dice", "renamed")
    return diagram


def test_a_block_keeps_its_stream_of_numbers_under_another_name_and_beside_others():
    diagram = among_others()
    before, after = ({placed.path: placed.stream for placed in plan(each).blocks} for each in (mixed(), diagram))
    assert after["renamed"] == before.pop("dice")
    assert before.items() <= after.items()
    assert len(set(after.values())) == len(after)


@pytest.mark.ci
def test_another_block_changes_no_others_numbers():
    before = Run(mixed(), watch=["dice.y", "dice.start"]).advance(300)
    diagram = among_others()
    after = Run(diagram, watch=["renamed.y", "renamed.start", "a die.y", "inner/more dice.y"]).advance(300)
    np.testing.assert_array_equal(before["dice.y"], after["renamed.y"])
    np.testing.assert_allclose(before["dice.start"], after["renamed.start"], 1e-6)
    assert not np.any(after["a die.y"] == after["renamed.y"])
    assert not np.any(after["a die.y"] == after["inner/more dice.y"])


@pytest.mark.ci
def test_a_subsystem_without_id_leaves_the_streams_of_its_blocks():
    inner, diagram = Diagram(), Diagram()
    inner.add("dice", Dice())
    diagram.add("group", inner, id="")
    one = Run(mixed(), watch=["dice.y"]).advance(5)["dice.y"]
    np.testing.assert_array_equal(one, Run(diagram, watch=["group/dice.y"]).advance(5)["group/dice.y"])


@pytest.mark.parametrize("make", [mixed, pytest.param(hosted, marks=pytest.mark.ci)])
def test_how_ticks_are_divided_changes_nothing(make):
    whole = Run(make(), seeds=2)
    parts = Run(make(), seeds=2)
    record = whole.advance(300)
    pieces = join([parts.advance(ticks) for ticks in (1, 0, 127, 2, 170)])
    assert pieces.signals.keys() == record.signals.keys()
    for address, signal in record.signals.items():
        np.testing.assert_array_equal(pieces[address], signal)
        np.testing.assert_array_equal(pieces.times(address), record.times(address))
    same(whole.state, parts.state)


def test_many_ticks_are_more_than_one_piece():
    run = Run(mixed(), seeds=2)
    longest = run._loop.longest
    pieces = list(run.stream(2 * longest + 5))
    assert [piece.ticks for piece in pieces] == [longest, longest, 5]
    assert join(pieces)["slow seen.u"].shape == (2, -(-(2 * longest + 5) // 4), 2)
    assert run.compilations == 1


@pytest.mark.parametrize("make", [mixed, hosted])
def test_what_follows_a_restored_state_is_what_followed_it(make):
    run = Run(make(), seeds=2)
    run.advance(131)
    kept = run.state
    first = run.advance(50)
    run["gain.gain" if make is mixed else "host.factor"] = 9.0
    other = run.advance(10)
    run.restore(kept)
    again = run.advance(50)
    for address, signal in first.signals.items():
        np.testing.assert_array_equal(again[address], signal)
    assert not np.array_equal(other["level.u"], run.advance(10)["level.u"])
    fresh = Run(make(), seeds=2)
    fresh.restore(kept)
    np.testing.assert_array_equal(fresh.advance(50)["level.u"], first["level.u"])


@pytest.mark.parametrize("make", [mixed, hosted])
def test_a_fork_goes_its_own_way(make):
    run = Run(make(), seeds=2)
    run.advance(7)
    fork = run.fork()
    address = "gain.gain" if make is mixed else "host.factor"
    fork[address] = 5.0
    assert run[address] != 5.0
    with_change = fork.advance(20)["level.u"]
    without = run.advance(20)["level.u"]
    assert not np.array_equal(with_change, without)
    assert fork.compilations == 1
    straight = Run(make(), seeds=2).advance(27)["level.u"]
    np.testing.assert_array_equal(straight[:, 7:], without)


@pytest.mark.parametrize("make", [mixed, pytest.param(hosted, marks=pytest.mark.ci)])
def test_the_interpreter_goes_on_from_a_compiled_state_and_back(make):
    run, slow = Run(make(), seeds=[5]), Interpreter(make(), 5)
    run.advance(130)
    slow.restore(run.state)
    np.testing.assert_allclose(slow.advance(5)["level.u"], run.advance(5)["level.u"], 1e-5)
    run.restore(slow.state)
    same(run.state, slow.state)
    np.testing.assert_allclose(slow.advance(3)["level.u"], run.advance(3)["level.u"], 1e-5)


@pytest.mark.ci
def test_an_edited_diagram_goes_on_where_its_blocks_are_the_same():
    diagram = mixed()
    run = Run(diagram, seeds=2)
    run.advance(50)
    edited = diagram.copy()
    edited.rename("dice", "coins")
    edited.replace("slow", UnitDelay(0.5, (2,), every=2))
    edited.add("new", Integrator(1.0))
    edited.connect("gain", "new")
    more = Run(edited, seeds=2)
    assert more.restore_matching(run.state) == ["new"]
    assert more.tick == 50
    np.testing.assert_array_equal(more.advance(20)["level.u"], run.advance(20)["level.u"])


def test_states_of_other_diagrams_and_seeds_are_refused():
    run = Run(mixed(), seeds=2)
    with pytest.raises(ValueError, match=r"state: blocks = .*dice.*: must be those of this diagram"):
        run.restore(Run(mixed(), seeds=3).state)
    with pytest.raises(ValueError, match="state: blocks"):
        run.restore(Run(hosted(), seeds=2).state)
    with pytest.raises(ValueError, match="must be with tick"):
        run.restore({})


def test_a_block_that_cannot_be_saved_says_so_before_it_runs():
    diagram = hosted()
    diagram.replace("host", Ticker(saved=False))
    for run in (Run(diagram), Interpreter(diagram)):
        with pytest.raises(ValueError, match="host: cannot be saved: it is made so"):
            _ = run.state
    assert Run(diagram).no_restore == {"host": "it is made so"}
    assert Run(hosted()).no_restore == {}


def test_swept_parameters_differ_from_seed_to_seed():
    diagram = Diagram()
    for name in ("a", "b"):
        diagram.add(name, Constant(2.0, (2,)))
    run = Run(diagram, seeds=3, sweep={"a.value": [1.0, 2.0, 3.0]}, watch=["a.y", "b.y"])
    record = run.advance(1)
    np.testing.assert_array_equal(record["a.y"][:, 0], [[1, 1], [2, 2], [3, 3]])
    np.testing.assert_array_equal(record["b.y"][:, 0], np.full((3, 2), 2))
    run["b.value"] = 5.0
    kept = run.state
    run["a.value"] = 4.0
    assert run.advance(1)["a.y"].tolist() == [[[4.0, 4.0]]] * 3
    run.restore(kept)
    record = run.advance(1)
    np.testing.assert_array_equal(record["a.y"][:, 0, 0], [1, 2, 3])
    np.testing.assert_array_equal(record["b.y"][:, 0, 0], [5, 5, 5])
    assert run.compilations == 1
    with pytest.raises(ValueError, match=r"a\.value: shape = \(2,\): must be \(3, …\), seeds first"):
        Run(diagram, seeds=3, sweep={"a.value": [1.0, 2.0]})


def test_reset_begins_again():
    run = Run(mixed(), seeds=2)
    first = run.advance(20)["level.u"]
    run.reset()
    np.testing.assert_array_equal(run.advance(20)["level.u"], first)


@pytest.mark.parametrize("seeds", [0, -1, [1, 1], [-1], [2**31], [], ["a"], True])
def test_impossible_seeds_are_refused(seeds):
    with pytest.raises(ValueError, match="seeds"):
        Run(mixed(), seeds=seeds)


@pytest.mark.parametrize("ticks", [-1, 1.5, True, 2**33])
def test_impossible_numbers_of_ticks_are_refused(ticks):
    with pytest.raises(ValueError, match="ticks"):
        Run(mixed()).advance(ticks)


def test_an_outlet_that_is_not_there_cannot_be_watched():
    with pytest.raises(ValueError, match=r"unknown output 'gain\.z': did you mean 'gain\.y'"):
        Run(mixed(), watch=["gain.z"])


def test_a_host_that_gives_a_wrong_shape_is_named():
    class Wrong(Ticker):
        def start(self, seeds, uniforms, threads=0):
            host = super().start(seeds, uniforms, threads)
            host.output = lambda block, inputs, now: {"y": np.zeros(3)}
            return host

    diagram = Diagram()
    diagram.add("wrong", Wrong())
    diagram.add("input", Constant(1.0))
    diagram.connect("input", "wrong")
    with pytest.raises(ValueError, match=r"wrong\.y: the host returns shape \(3,\): must be \(1, 2\)"):
        Run(diagram).advance(1)


class Times(Adding):
    """Keeps the times that it is given."""

    def __init__(self, start):
        super().__init__(start)
        self.given = []

    def output(self, block, inputs, now):
        self.given.append((now.tick, now.time, now.step))
        return super().output(block, inputs, now)

    def update(self, block, inputs, now):
        self.given.append((now.tick, now.time, now.step))
        super().update(block, inputs, now)


@dataclasses.dataclass(frozen=True)
class Timed(Ticker):
    """A host that keeps the times that it is given, of all runs."""

    name: ClassVar[str] = "timed"
    hosts: ClassVar[list[Times]] = []

    def start(self, seeds, uniforms, threads=0):
        self.hosts.append(Times(uniforms[:, 0]))
        return self.hosts[-1]


@pytest.mark.parametrize("engine", [Run, Interpreter])
def test_hosts_are_given_exact_times(engine):
    """In single precision, 1,000,000.01 s is 1,000,000 s, and a step of 0.03 s is not 0.03 s."""
    diagram, first = Diagram(0.01), 100_000_002
    diagram.add("dice", Chance())
    diagram.add("host", Timed(every=3))
    run = engine(wire(diagram, "dice host"))
    run.restore({**run.state, "tick": first})
    run.advance(4)
    ticks = [first, first, first + 3, first + 3]
    assert Timed.hosts[-1].given == [(tick, tick * 0.01, 3 * 0.01) for tick in ticks]
