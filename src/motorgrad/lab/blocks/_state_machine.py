"""A finite-state machine given as a table."""

import dataclasses
from typing import Annotated, Any, ClassVar

import jax.numpy as jnp
import numpy as np

from motorgrad._errors import check, unknown
from motorgrad.lab._block import Block, Moment, Ports, Signals
from motorgrad.lab._parameter import Parameter, Setting
from motorgrad.lab._port import Port
from motorgrad.lab.blocks._formula import named_values
from motorgrad.lab.blocks._grammar import RESERVED, evaluate, formula
from motorgrad.lab.blocks._named import check_names

MOST = 1000  # transitions
ANY = "*"


@dataclasses.dataclass(frozen=True)
class StateMachine(Block):
    """A finite-state machine, one for each element of `shape`.

    At each evaluation, in each machine, the first transition of the table that begins at the present state (or at
    `"*"`, any) and whose condition holds is made; where none is, the state stays. A condition is a formula as of the
    block "expression". It may use the inputs, the constants, the time `t`, and `since`, the time in this state, both in
    seconds. The output `state` is a number, from 0 in the order of `states`; the outputs in `gives` are what the
    `table` has for it.

    If `immediate`, the outputs are those of the state after the transitions of this evaluation; else of the state
    before, and then they do not depend on the inputs at once.
    """

    name: ClassVar[str] = "state machine"
    category: ClassVar[str] = "logic"

    states: Annotated[tuple[str, ...], Setting("the names of the states")] = ("off", "on")
    transitions: Annotated[
        tuple[tuple[str, str, str], ...], Setting("rows: from which state, on which condition, to which state")
    ] = (("off", "u > 0", "on"), ("on", "u <= 0", "off"))
    reads: Annotated[tuple[str, ...], Setting("the names of the inputs")] = ("u",)
    gives: Annotated[tuple[str, ...], Setting("the names of the outputs beside state")] = ()
    table: Annotated[Any, Parameter("what it gives: a row for each state, a column for each output")] = 0.0
    constants: Annotated[tuple[str, ...], Setting("names of numbers that may be changed while it runs")] = ()
    numbers: Annotated[Any, Parameter("the numbers of the constants, in their order")] = 0.0
    initial: Annotated[Any, Setting("the state at first, one or a list of shape; '' for the first")] = ""
    immediate: Annotated[bool, Setting("whether a transition shows in the outputs at once")] = False
    shape: Annotated[tuple[int, ...], Setting("shape of the signals: how many machines there are")] = ()

    def validate(self) -> None:
        check_names("states", self.states, least=1)
        check_names("reads", self.reads, {*RESERVED, "t", "since"})
        check_names("constants", self.constants, {*RESERVED, *self.reads, "t", "since"})
        check_names("gives", self.gives, {"state"})
        check(isinstance(self.immediate, bool), "immediate", self.immediate, "true or false")
        self.check_broadcasts("numbers", (len(self.constants),) if self.constants else ())
        self.check_broadcasts("table", (len(self.states), len(self.gives)) if self.gives else ())
        rows = isinstance(self.transitions, tuple) and len(self.transitions) <= MOST
        check(rows, "transitions", self.transitions, f"a list of at most {MOST} transitions")
        for place, row in enumerate(self.transitions):
            three = isinstance(row, tuple) and len(row) == 3
            check(three, f"transitions[{place}]", row, "a list of a state, a condition and a state")
            for end, known in ((row[0], (*self.states, ANY)), (row[2], self.states)):
                if end not in known:
                    raise unknown(f"state in transitions[{place}]", end, known)
            formula(f"transitions[{place}]", row[1], self._names)
        try:
            initial = np.asarray(self.initial, object)
        except ValueError:  # lists of different lengths
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

    def init(self, uniforms: Any) -> Any:
        """The states, and for how many seconds they have been so."""
        number = {"": 0} | {state: place for place, state in enumerate(self.states)}
        first = np.vectorize(number.__getitem__, otypes=[np.int32])(np.asarray(self.initial, object))
        return jnp.broadcast_to(jnp.asarray(first), self.shape), jnp.zeros(self.shape)

    def _after(self, state: Any, inputs: Signals, now: Moment) -> Any:
        before, since = state
        values = {"t": now.time, "since": since, **named_values(self.constants, self.numbers), **inputs}
        after = before
        for start, condition, end in reversed(self.transitions):  # so that the first has the last word
            holds = evaluate(formula("condition", condition, self._names), values) != 0
            here = holds if start == ANY else holds & (before == self.states.index(start))
            after = jnp.where(here, self.states.index(end), after)
        return after.astype(jnp.int32)

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        shown = self._after(state, inputs, now) if self.immediate else state[0]
        table = jnp.broadcast_to(self.table, (len(self.states), len(self.gives)))
        return {"state": shown, **{name: table[shown, column] for column, name in enumerate(self.gives)}}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        after = self._after(state, inputs, now)
        return after, jnp.where(after == state[0], state[1] + now.step, now.step)
