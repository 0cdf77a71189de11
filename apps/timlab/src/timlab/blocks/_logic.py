"""Logic: conditions, switches, events, state machines."""

import dataclasses
import functools
from typing import Any, ClassVar, Literal

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, PyTree

from motorgrad._errors import check, unknown
from motorgrad.schema import count, number, static
from timlab.blocks._base import Shaped, check_names
from timlab.blocks._formulas import OPERATORS, RESERVED, Comparison, evaluate_at, formula
from timlab.blocks._maths import MAX_PORTS, named_values
from timlab.diagram import Block, Moment, Port, Ports, Signals

ORDERED = {">=": (1.0, True), "<": (1.0, False), "<=": (-1.0, True), ">": (-1.0, False)}
"""Of a relation: the sign of the difference that is watched, and the relation's value where that is at least 0."""


@dataclasses.dataclass(frozen=True)
class Compare(Shaped):
    """Compare `u1` with `u2` + `margin`, element by element. An unconnected `u2` is 0.

    A solver that adapts its steps locates where an order (`<`, `<=`, `>`, `>=`) changes.
    """

    name: ClassVar[str] = "compare"
    category: ClassVar[str] = "logic"

    relation: Comparison = static(">", help="relation of u1 to u2 + margin")
    margin: Any = number(0.0, help="offset added to u2")

    @property
    def inputs(self) -> Ports:
        return {"u1": Port(self.shape), "u2": Port(self.shape, default=0.0)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, "bool")}

    def crossings(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Array:
        """The distance in the direction in which zero counts as the relation says."""
        if self.relation not in ORDERED:
            return jnp.zeros(0)
        return self.filled(ORDERED[self.relation][0] * (inputs["u1"] - inputs["u2"] - self.margin)).ravel()

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        if now.above is None or self.relation not in ORDERED:
            return {"y": OPERATORS[self.relation].apply(inputs["u1"], inputs["u2"] + self.margin)}
        return {"y": (now.above == ORDERED[self.relation][1]).reshape(self.shape)}


@dataclasses.dataclass(frozen=True)
class Logic(Block):
    """Combine the conditions `u1`, `u2`, …, element by element. `"xor"` is true if an odd number of them is true."""

    name: ClassVar[str] = "logic"
    category: ClassVar[str] = "logic"

    operator: Literal["and", "or", "xor", "nand", "nor"] = static("and", help="the operation")
    count: int = count(2, 1, MAX_PORTS, help="number of inputs")
    shape: tuple[int, ...] = static((), help="shape of the signals")

    @property
    def inputs(self) -> Ports:
        return {f"u{number}": Port(self.shape, "bool") for number in range(1, self.count + 1)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, "bool")}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        join = {"and": jnp.logical_and, "or": jnp.logical_or, "xor": jnp.logical_xor}
        positive = {"nand": "and", "nor": "or"}.get(self.operator, self.operator)
        joined = functools.reduce(join[positive], inputs.values())
        return {"y": joined if positive == self.operator else ~joined}


@dataclasses.dataclass(frozen=True)
class Not(Block):
    """Logical negation, element by element."""

    name: ClassVar[str] = "not"
    category: ClassVar[str] = "logic"

    shape: tuple[int, ...] = static((), help="shape of the signals")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape, "bool")}

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, "bool")}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": ~inputs["u"]}


@dataclasses.dataclass(frozen=True)
class Switch(Shaped):
    """Output `on` where the condition is true, else `off`, element by element."""

    name: ClassVar[str] = "switch"
    category: ClassVar[str] = "logic"

    @property
    def inputs(self) -> Ports:
        return {"condition": Port(self.shape, "bool"), "on": Port(self.shape), "off": Port(self.shape)}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": jnp.where(inputs["condition"], inputs["on"], inputs["off"])}


@dataclasses.dataclass(frozen=True)
class MultiSwitch(Shaped):
    """Select one of the inputs `u0`, `u1`, … by `index`, which is clipped to the valid range."""

    name: ClassVar[str] = "multi-switch"
    category: ClassVar[str] = "logic"

    count: int = count(2, 1, MAX_PORTS, help="number of inputs to select from")

    @property
    def inputs(self) -> Ports:
        return {"index": Port((), "int"), **{f"u{number}": Port(self.shape) for number in range(self.count)}}

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        choices = jnp.stack([inputs[f"u{number}"] for number in range(self.count)])
        return {"y": choices[jnp.clip(inputs["index"], 0, self.count - 1)]}


Edge = Literal["rising", "falling", "either", "true"]
WHEN = "which events count: changes of the condition, or every evaluation at which it is true"


def event(edge: str, before: Array, now: Array) -> Array:
    """Where an event occurs, for a condition that was `before` and is `now`."""
    if edge == "true":
        return now
    return {"rising": now & ~before, "falling": before & ~now, "either": now ^ before}[edge]


@dataclasses.dataclass(frozen=True)
class Counter(Block):
    """Count events of the input, including one at the current evaluation. The count restarts at 0 after `modulus` − 1,
    unless `modulus` is 0, and wherever `reset` is true. Before the first evaluation the condition counts as false.
    """

    name: ClassVar[str] = "counter"
    category: ClassVar[str] = "logic"

    modulus: Any = number(0, 0, kind="int", help="the count wraps to 0 at this number; 0 for never")
    edge: Edge = static("rising", help=WHEN)
    shape: tuple[int, ...] = static((), help="shape of the signals")

    def validate(self) -> None:
        self.check_broadcasts("modulus", self.shape)

    @property
    def inputs(self) -> Ports:
        return {
            "u": Port(self.shape, "bool"),
            "reset": Port((), "bool", default=0.0, help="set the count to 0; overrides events"),
        }

    @property
    def outputs(self) -> Ports:
        return {"count": Port(self.shape, "int")}

    def init(self, uniforms: Array) -> PyTree[Array]:
        """The count, and the previous condition."""
        return jnp.zeros(self.shape, jnp.int32), jnp.zeros(self.shape, bool)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"count": self.update(state, inputs, now)[0]}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        count, before = state
        count = count + event(self.edge, before, inputs["u"]).astype(jnp.int32)
        count = jnp.where(self.modulus > 0, count % jnp.maximum(self.modulus, 1), count)
        return jnp.where(inputs["reset"], 0, count), inputs["u"]


@dataclasses.dataclass(frozen=True)
class SampleAndHold(Shaped):
    """Sample the input at events of the condition `sample` and hold it; `initial` before the first event."""

    name: ClassVar[str] = "sample and hold"
    category: ClassVar[str] = "logic"

    initial: Any = number(0.0, help="output before the first sample")
    edge: Edge = static("rising", help=WHEN)

    @property
    def inputs(self) -> Ports:
        return {"u": Port(self.shape), "sample": Port((), "bool")}

    def init(self, uniforms: Array) -> PyTree[Array]:
        """The held value, and the previous condition."""
        return self.filled(self.initial), jnp.zeros((), bool)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        return {"y": self.update(state, inputs, now)[0]}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        held, before = state
        return jnp.where(event(self.edge, before, inputs["sample"]), inputs["u"], held), inputs["sample"]


MAX_TRANSITIONS = 1000
ANY = "*"


@dataclasses.dataclass(frozen=True)
class StateMachine(Block):
    """A finite-state machine for each element of `shape`.

    At each evaluation, each machine makes the first transition of the list that starts at its current state (or at
    `"*"`, any state) and whose condition holds; if there is none, it stays. A condition is a formula as in the block
    "expression". It may use the inputs, the constants, the time `t`, and `since`, the time in the current state, both
    in seconds. The output `state` is the index of the state in `states`; the outputs named in `gives` are that state's
    row of `table`.

    If `immediate`, the outputs are those of the state after this evaluation's transition; otherwise those of the state
    before it, and then they do not depend on the inputs within the tick.
    """

    name: ClassVar[str] = "state machine"
    category: ClassVar[str] = "logic"

    states: tuple[str, ...] = static(("off", "on"), help="names of the states")
    transitions: tuple[tuple[str, str, str], ...] = static(
        (
            ("off", "u > 0", "on"),
            ("on", "u <= 0", "off"),
        ),
        help="rows: from state, condition, to state",
    )
    reads: tuple[str, ...] = static(("u",), help="names of the inputs")
    gives: tuple[str, ...] = static((), help="names of the outputs in addition to state")
    table: Any = number(0.0, help="output values: one row per state, one column per output")
    constants: tuple[str, ...] = static((), help="names of constants that may change during a run")
    numbers: Any = number(0.0, help="values of the constants, in their order")
    initial: Any = static("", help="initial state, one or a list of shape; '' for the first state")
    immediate: bool = static(False, help="whether outputs follow a transition within the tick")
    shape: tuple[int, ...] = static((), help="shape of the signals: one machine per element")

    def validate(self) -> None:
        check_names("states", self.states, least=1)
        check_names("reads", self.reads, {*RESERVED, "t", "since"})
        check_names("constants", self.constants, {*RESERVED, *self.reads, "t", "since"})
        check_names("gives", self.gives, {"state"})
        self.check_broadcasts("numbers", (len(self.constants),) if self.constants else ())
        self.check_broadcasts("table", (len(self.states), len(self.gives)) if self.gives else ())
        rows = len(self.transitions) <= MAX_TRANSITIONS
        check(rows, "transitions", self.transitions, f"a list of at most {MAX_TRANSITIONS} transitions")
        for place, row in enumerate(self.transitions):
            for end, known in ((row[0], (*self.states, ANY)), (row[2], self.states)):
                if end not in known:
                    raise unknown(f"state in transitions[{place}]", end, known)
            formula(f"transitions[{place}]", row[1], self._names)
        try:
            initial = np.asarray(self.initial, object)
        except ValueError:  # ragged lists
            initial = np.zeros(0, object)
        fits = initial.shape in ((), self.shape)
        check(fits, "initial", self.initial, f"one state, or a list of them of shape {self.shape}")
        for state in initial.ravel():
            if state not in ("", *self.states):
                raise unknown("state in initial", state, self.states)

    @property
    def _names(self) -> tuple[str, ...]:
        return (*self.reads, *self.constants, "t", "since")

    @property
    def inputs(self) -> Ports:
        return {name: Port(self.shape, feedthrough=self.immediate) for name in self.reads}

    @property
    def outputs(self) -> Ports:
        return {"state": Port(self.shape, "int"), **{name: Port(self.shape) for name in self.gives}}

    def init(self, uniforms: Array) -> PyTree[Array]:
        """The states, and the number of evaluations since they were entered: their sum in seconds would drift."""
        number = {"": 0} | {state: place for place, state in enumerate(self.states)}
        first = np.vectorize(number.__getitem__, otypes=[np.int32])(np.asarray(self.initial, object))
        return jnp.broadcast_to(jnp.asarray(first), self.shape), jnp.zeros(self.shape, jnp.uint32)

    def _after(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Any:
        before, spent = state
        constants = named_values(self.constants, self.numbers)
        times = {"t": now.doubled(lambda time: time), "since": now.spent(spent)}
        nearly = {name: now.doubled(lambda _, time=time: time + now.blur) for name, time in times.items()}
        both = {name: (times[name], nearly[name]) for name in times}
        after = before
        # in reverse, so that the first matching transition is applied last and wins
        for start, condition, end in reversed(self.transitions):
            holds = evaluate_at(formula("condition", condition, self._names), both, constants, inputs) != 0
            here = holds if start == ANY else holds & (before == self.states.index(start))
            after = jnp.where(here, self.states.index(end), after)
        return after.astype(jnp.int32)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        shown = self._after(state, inputs, now) if self.immediate else state[0]
        table = jnp.broadcast_to(self.table, (len(self.states), len(self.gives)))
        return {"state": shown, **{name: table[shown, column] for column, name in enumerate(self.gives)}}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        after = self._after(state, inputs, now)
        return after, jnp.where(after == state[0], state[1] + jnp.uint32(1), jnp.uint32(1))
