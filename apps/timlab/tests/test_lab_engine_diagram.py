"""Diagrams as data: names, wires, subsystems, and what is refused before anything runs."""

import dataclasses
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
import pytest

from lab_examples import Chance, Dice, agree, leak, wire
from motorgrad.schema import number, static
from timlab import (
    BLOCKS,
    Block,
    Constant,
    Diagram,
    DiagramError,
    Gain,
    Inlet,
    Integrator,
    Interpreter,
    Outlet,
    Port,
    Run,
    Sum,
    UnitDelay,
    parameters_of,
    problems,
    settings_of,
)


def chain(*blocks: Any) -> Diagram:
    """Blocks with one input and one output behind each other, called a, b, c, …"""
    diagram = Diagram()
    for name, block in zip("abcdefgh", blocks, strict=False):
        diagram.add(name, block)
    for one, other in zip("abcdefgh", list(diagram.nodes)[1:], strict=False):
        diagram.connect(one, other)
    return diagram


@pytest.mark.parametrize("name", BLOCKS)
def test_every_block_declares_itself(name):
    kind = BLOCKS[name]
    assert kind.name == name
    assert kind.category
    assert kind.__doc__
    assert not kind.__doc__.startswith(f"{kind.__name__}(")
    declared = {**parameters_of(kind), **settings_of(kind)}
    assert set(declared) == {field.name for field in dataclasses.fields(kind) if field.init}
    assert all(part.help for part in declared.values())


def test_an_algebraic_loop_is_named():
    diagram = chain(Gain(), Gain(), Gain())
    diagram.add("sum", Sum())
    wire(diagram, "c sum.u1", "sum a")
    diagram.add("one", Constant(1.0))
    diagram.connect("one", "sum.u2")
    with pytest.raises(DiagramError, match=r"algebraic loop: .*; insert a delay") as caught:
        Run(diagram)
    loop = str(caught.value).split("algebraic loop: ")[1].split(";")[0].split(" → ")
    assert loop[0] == loop[-1]
    assert "→".join(loop[:-1] * 2).find("a→b→c→sum") >= 0
    assert len(loop) == 5
    with pytest.raises(DiagramError, match="algebraic loop"):
        Interpreter(diagram)
    diagram.disconnect("sum.u1")
    diagram.add("delay", UnitDelay())
    wire(diagram, "c delay", "delay sum.u1")
    assert problems(diagram) == []
    agree(diagram)


def test_a_loop_through_subsystems_is_named_by_paths():
    inner = wire(_with(Diagram(), u=Inlet(), gain=Gain(), y=Outlet()), "u gain", "gain y")
    diagram = wire(_with(Diagram(), one=inner, other=inner.copy()), "one other", "other one")
    with pytest.raises(DiagramError, match=r"one/gain → other/gain → one/gain|other/gain → one/gain → other/gain"):
        Run(diagram)


def test_a_subsystem_that_delays_cuts_a_loop():
    inner = wire(_with(Diagram(), u=Inlet(), delay=UnitDelay(1.0), y=Outlet()), "u delay", "delay y")
    diagram = wire(_with(Diagram(), one=inner, gain=Gain(0.5)), "one gain", "gain one")
    record = Run(diagram, watch=["gain.y"]).advance(4)
    np.testing.assert_array_equal(record["gain.y"][0], [0.5, 0.25, 0.125, 0.0625])


def test_wires_in_a_circle_are_refused():
    through = wire(_with(Diagram(), u=Inlet(), y=Outlet()), "u y")
    diagram = wire(_with(Diagram(), one=through, gain=Gain()), "one gain", "one one")
    assert [str(problem) for problem in problems(diagram)] == ["one.y: the wires form a loop that contains no block"]


@pytest.mark.parametrize(
    ("diagram", "path", "port", "says"),
    [
        (
            lambda: chain(Constant(shape=(3,)), Gain(shape=(2,))),
            "b",
            "u",
            "accepts floats of shape (2,), but a.y outputs floats of shape (3,)",
        ),
        (
            lambda: chain(Chance((2,), "float"), Gain(shape=(3,))),
            "b",
            "u",
            "accepts floats of shape (3,), but a.y outputs floats of shape (2,)",
        ),
        (lambda: chain(Constant(), Outlet(kind="bool")), "b", "u", "accepts one bool, but a.y outputs one float"),
        (lambda: chain(Gain()), "a", "u", "not connected"),
        (lambda: chain(Constant(), Integrator(every=2)), "b", None, "every = 2 ticks: must be 1"),
        (lambda: chain(Constant(period=0.015)), "a", None, "period = 0.015: must be a whole number of ticks of 0.01 s"),
        (lambda: chain(Constant(), leak()), "b/missing", None, ""),
    ],
)
def test_what_does_not_fit_is_named_by_block_and_port(diagram, path, port, says):
    found = problems(diagram())
    if not says:
        assert found == []
        return
    assert [(problem.path, problem.port) for problem in found] == [(path, port)]
    assert says in found[0].message
    with pytest.raises(DiagramError) as caught:
        Run(diagram())
    assert caught.value.problems == tuple(found)


def test_all_problems_are_told_at_once():
    diagram = chain(Gain(shape=(2,)), Gain(shape=(3,)))
    inner = _with(Diagram(), gain=Gain(), y=Outlet())
    diagram.add("inner", inner)
    diagram.add("end", Outlet())
    diagram.connect("inner", "end")
    found = {str(problem).split(": ")[0] for problem in problems(diagram)}
    assert found == {"a.u", "b.u", "inner/gain.u", "inner/y.u"}
    with pytest.raises(DiagramError, match=r"\(and 3 more\)"):
        Run(diagram)


def test_misfits_are_seen_while_a_wire_is_drawn():
    diagram = chain(Constant(shape=(3,)), Gain(shape=(2,)))
    assert diagram.mismatch("a", "b") == "b.u: accepts floats of shape (2,), but a.y outputs floats of shape (3,)"
    assert "unknown block 'x'" in diagram.mismatch("x", "b")
    diagram.add("yes", Chance(kind="bool"))
    diagram.add("gain", Gain())
    assert diagram.mismatch("yes", "gain") is None


@pytest.mark.parametrize(
    ("act", "says"),
    [
        (lambda d: d.add("a", Gain()), "name = 'a': must be a new name in the diagram"),
        (lambda d: d.add("", Gain()), "name = '': must be a string of 1"),
        (lambda d: d.add("x.y", Gain()), r"name = 'x\.y': must be a string"),
        (lambda d: d.add("x/y", Gain()), "name = 'x/y': must be a string"),
        (lambda d: d.add("x\n", Gain()), "must be a string"),
        (lambda d: d.add("x", Gain(), id="a"), "id = 'a': must be a new"),
        (lambda d: d.add("x", Gain(), id=""), "id = ''"),
        (lambda d: d.add("x", 3), "block = 3: must be a Block or a Diagram"),
        (lambda d: d.add("x", d), "must be a diagram that does not contain this one"),
        (lambda d: d.connect("a", "b"), r"b\.u = 'a': must be disconnected first: a\.y leads there"),
        (lambda d: d.connect("b", "a"), "unknown input of a: '': known are none"),
        (lambda d: d.connect("a.x", "b"), "unknown output of a: 'x'"),
        (lambda d: d.connect("c", "b"), "unknown block 'c'"),
        (lambda d: d.disconnect("a"), "unknown input of a"),
        (lambda d: d.remove("c"), "unknown block 'c'"),
        (lambda d: d.rename("a", "b"), "name = 'b': must be a new"),
        (lambda d: d.replace("c", Gain()), "unknown block 'c'"),
        (lambda d: Diagram(tick=0), "tick = 0: must be a positive number of seconds"),
        (lambda d: Diagram(tick=float("nan")), "tick = nan"),
        (lambda d: Diagram(substeps=0), "substeps = 0: must be an integer from 1 to 1000"),
    ],
)
def test_impossible_edits_are_refused_and_change_nothing(act, says):
    diagram = chain(Constant(), Gain())
    before = diagram.copy()
    with pytest.raises(ValueError, match=says):
        act(diagram)
    assert diagram == before


def test_edits():
    diagram = chain(Constant(2.0), Gain(3.0), Outlet())
    diagram.rename("b", "factor")
    assert diagram.nodes["factor"].id == "b"
    assert list(diagram.nodes) == ["a", "factor", "c"]
    assert Run(diagram).advance(1)["c.u"] == 6.0
    diagram.replace("factor", Gain(4.0))
    assert Run(diagram).advance(1)["c.u"] == 8.0
    diagram.replace("factor", Sum("+"))
    assert set(diagram.wires) == {("c", "u")}
    diagram.connect("a", "factor")
    assert Run(diagram).advance(1)["c.u"] == 2.0
    diagram.remove("factor")
    assert diagram.wires == {}
    assert diagram.add("b", Gain()) == "b"
    assert diagram.nodes["b"].id == "b"
    diagram.rename("b", "other")
    diagram.add("b", Gain())
    assert diagram.nodes["b"].id == "b 2"


def test_a_copy_is_changed_by_itself():
    diagram = _with(Diagram(), inner=leak())
    copy = diagram.copy()
    assert copy == diagram
    copy.nodes["inner"].block.remove("rate")
    assert copy != diagram
    assert "rate" in diagram.nodes["inner"].block.nodes


def test_a_diagram_cannot_be_put_into_itself_later():
    outer, inner = Diagram(), Diagram()
    outer.add("inner", inner)
    with pytest.raises(ValueError, match="does not contain this one"):
        inner.add("outer", outer)


def test_the_same_id_twice_is_refused():
    diagram = _with(Diagram(), dice=Dice())
    diagram.add("group", _with(Diagram(), dice=Dice()), id="")
    assert [str(problem) for problem in problems(diagram)] == ["group/dice: has the same id, 'dice', as dice"]


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: Gain(float("inf")), "gain = inf: must be a finite number"),
        (lambda: Gain([[1.0], [2.0, 3.0]]), "gain = "),
        (lambda: Gain("1"), "gain = '1'"),
        (lambda: Gain(True), None),
        (lambda: Gain(shape=(0,)), r"shape = \(0,\): must be a list of integers from 1"),
        (lambda: Gain(shape=3), "shape = 3"),
        (lambda: Gain(every=0), "every = 0: must be an integer of at least 1"),
        (lambda: Gain(period=-1.0), "period = -1.0"),
        (lambda: Gain(every=2, period=1.0), "period = 1.0: must be None where every is given"),
        (lambda: Gain([1.0, 2.0], (3,)), r"gain: shape = \(2,\): must be one that broadcasts to \(3,\)"),
        (lambda: Inlet(kind="text"), "unknown kind 'text'"),
        (lambda: Gain(1e39), "gain = 1e\\+39"),
    ],
)
def test_impossible_blocks_are_refused(make, says):
    if says is None:
        assert make().gain == 1.0
        return
    with pytest.raises(ValueError, match=says):
        make()


def test_a_parameter_within_its_range():
    @dataclasses.dataclass(frozen=True)
    class Leak(Block):
        """Forgets."""

        name: ClassVar[str] = "leak"
        category: ClassVar[str] = "tests"
        decay: Any = number(0.9, 0, 1, open_low=True, open_high=True, unit="1/s", help="what is kept")
        count: Any = number(3, kind="int", help="how often")

    assert Leak([0.5, 0.25]).decay == (0.5, 0.25)
    with pytest.raises(ValueError, match=r"decay = 1\.0: must be in \(0, 1\), in 1/s"):
        Leak(1.0)
    for wrong in (1.5, 2**31):
        with pytest.raises(ValueError, match="count"):
            Leak(count=wrong)


@dataclasses.dataclass(frozen=True)
class Broken(Block):
    """Does not keep what it declares, in the way that `how` says."""

    name: ClassVar[str] = "broken"
    category: ClassVar[str] = "tests"
    how: str = static("shape", help="in which way")

    @property
    def inputs(self):
        return {"u": Port(feedthrough=False)}

    @property
    def outputs(self):
        return {"y": Port(kind="int" if self.how == "kind" else "float")}

    def init(self, uniforms):
        return {"x": jnp.zeros(2)}

    def output(self, state, inputs, now):
        if self.how == "feedthrough":
            return {"y": inputs["u"]}
        if self.how == "raises":
            raise RuntimeError("it broke")
        return {"z" if self.how == "name" else "y": jnp.zeros(2 if self.how == "shape" else ())}

    def update(self, state, inputs, now):
        if self.how == "structure":
            return {}
        return {"x": jnp.zeros(3)} if self.how == "state" else state


@pytest.mark.parametrize(
    ("how", "port", "says"),
    [
        ("shape", "y", "output: returns float32[2], but the port declares one float"),
        ("kind", "y", "output: returns float32[], but the port declares one int"),
        ("name", None, "output: returns ['z'], but the block declares ['y']"),
        ("feedthrough", None, "output: reads the input 'u', which does not exist or is declared without"),
        ("raises", None, "output: RuntimeError: it broke"),
        ("state", None, "update: returns float32[3] for state['x'], which is float32[2]"),
        ("structure", None, "update: returns"),
    ],
)
def test_a_block_that_does_not_keep_what_it_declares_is_named(how, port, says):
    found = problems(chain(Constant(), Broken(how)))
    assert [(problem.path, problem.port) for problem in found] == [("b", port)]
    assert found[0].message.startswith(says)


def test_inlets_are_parameters_of_the_whole_and_ports_of_a_part():
    inner = leak()
    assert list(inner.inputs) == ["u"]
    assert list(inner.outputs) == ["y"]
    run = Run(inner, watch=["u.y"])
    run["u.value"] = 3.0
    assert run.advance(2)["u.y"].tolist() == [[3.0, 3.0]]
    outer = _with(Diagram(), part=inner, end=Outlet())
    outer.connect("part", "end")
    open_end = Run(outer)
    open_end["part/u.value"] = 3.0
    np.testing.assert_array_equal(open_end.advance(50)["end.u"], _outlet(inner, 3.0, 50))


def _outlet(diagram: Diagram, value: float, ticks: int) -> np.ndarray:
    run = Run(diagram)
    run["u.value"] = value
    return run.advance(ticks)["y.u"]


def _with(diagram: Diagram, **blocks: Any) -> Diagram:
    for name, block in blocks.items():
        diagram.add(name, block)
    return diagram
