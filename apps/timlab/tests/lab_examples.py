"""Diagrams and blocks that several tests use."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.schema import count, number, static
from timlab import (
    Block,
    Diagram,
    From,
    Gain,
    Host,
    HostBlock,
    HostMoment,
    Inlet,
    Integrator,
    Interpreter,
    Moment,
    Outlet,
    Port,
    Ports,
    Run,
    Signals,
    Sum,
)


@dataclasses.dataclass(frozen=True)
class Dice(Block):
    """Numbers from U[0, 1), from a start that is drawn too."""

    name: ClassVar[str] = "dice"
    category: ClassVar[str] = "tests"
    size: int = count(2, help="how many")

    @property
    def outputs(self) -> Ports:
        return {"y": Port((self.size,)), "start": Port()}

    @property
    def uniforms(self) -> int:
        return self.size

    @property
    def init_uniforms(self) -> int:
        return 1

    def init(self, uniforms: Any) -> Any:
        return {"start": uniforms[0], "sum": jnp.zeros(())}

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        return {"y": now.uniforms, "start": state["start"] + state["sum"]}

    def update(self, state: Any, inputs: Signals, now: Moment) -> Any:
        return state | {"sum": 0.9 * state["sum"] + now.uniforms[0]}


@dataclasses.dataclass(frozen=True)
class Ticker(HostBlock):
    """A host: adds what it is given, times a factor, to what it has; with `direct` it gives its input too."""

    name: ClassVar[str] = "ticker"
    category: ClassVar[str] = "tests"
    factor: Any = number(1.0, help="the factor")
    direct: bool = static(False, help="whether it feeds through")
    saved: bool = static(True, help="whether it can be saved")

    @property
    def inputs(self) -> Ports:
        return {"u": Port(feedthrough=self.direct)}

    @property
    def outputs(self) -> Ports:
        return {"y": Port((2,))}

    @property
    def uniforms(self) -> int:
        return 1

    @property
    def init_uniforms(self) -> int:
        return 1

    @property
    def no_restore(self) -> str | None:
        return None if self.saved else "it is made so"

    def start(self, seeds: np.ndarray, uniforms: np.ndarray, threads: int = 0) -> Host:
        return Adding(uniforms[:, 0])


class Adding(Host):
    """The host of a `Ticker`."""

    def __init__(self, start: np.ndarray):
        self.total = start.astype(np.float32)

    def output(self, block: Ticker, inputs: dict[str, np.ndarray], now: HostMoment) -> dict[str, np.ndarray]:
        assert set(inputs) == ({"u"} if block.direct else set())
        second = inputs["u"] + now.uniforms[:, 0] if block.direct else now.uniforms[:, 0]
        return {"y": np.stack([self.total, second], axis=1)}

    def update(self, block: Ticker, inputs: dict[str, np.ndarray], now: HostMoment) -> None:
        self.total = (0.5 * self.total + block.factor * inputs["u"] + now.uniforms[:, 0]).astype(np.float32)

    def snapshot(self) -> dict[str, np.ndarray]:
        return {"total": self.total.copy()}

    def restore(self, snapshot: Mapping[str, np.ndarray]) -> None:
        self.total = snapshot["total"].copy()


@dataclasses.dataclass(frozen=True)
class Chance(Block):
    """A source of any shape and kind."""

    name: ClassVar[str] = "chance"
    category: ClassVar[str] = "tests"
    shape: tuple[int, ...] = static((), help="shape of the signal")
    kind: str = static("float", help="kind of the signal")
    scale: float = static(1.0, help="greatest size of a float")

    @property
    def outputs(self) -> Ports:
        return {"y": Port(self.shape, self.kind)}  # type: ignore[arg-type]

    @property
    def uniforms(self) -> int:
        return int(np.prod(self.shape))

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        drawn = now.uniforms.reshape(self.shape)
        of_kind = {"float": self.scale * (2 * drawn - 1), "int": jnp.int32(2 * drawn), "bool": drawn < 0.3}
        return {"y": of_kind[self.kind]}


@dataclasses.dataclass(frozen=True)
class Scattered(Chance):
    """A `Chance` that draws nothing, which is quick to compile: numbers follow from the tick and from `which` it is."""

    name: ClassVar[str] = "scattered"
    which: int = count(0, help="others have other numbers")

    @property
    def uniforms(self) -> int:
        return 0

    def output(self, state: Any, inputs: Signals, now: Moment) -> Signals:
        places = jnp.arange(super().uniforms, dtype=jnp.uint32)
        drawn = (now.tick * 37 + places * 53 + self.which * 11 + 5) % 97
        return super().output(state, inputs, now._replace(uniforms=drawn / jnp.float32(97)))


def outputs(diagram: Diagram, prefix: str = "") -> list[str]:
    """The addresses of all outputs of blocks, in subsystems too."""
    found = []
    for name, node in diagram.nodes.items():
        if isinstance(node.block, Diagram):
            found += outputs(node.block, f"{prefix}{name}/")
        elif not isinstance(node.block, From) and not (isinstance(node.block, Inlet) and prefix):
            found += [f"{prefix}{name}.{port}" for port in node.block.outputs]
    return found


def agree(diagram: Diagram, ticks: int = 20, seeds: tuple[int, ...] = (3, 0), tolerance: float = 2e-5) -> Run:
    """See that the interpreter and the compiled form give the same signals and states, of several seeds."""
    watch = outputs(diagram)
    run = Run(diagram, seeds, watch=watch)
    record = run.advance(ticks)
    state = None if run.no_restore else run.state
    for row, seed in enumerate(seeds):
        slow = Interpreter(diagram, seed, watch)
        expected = slow.advance(ticks)
        assert set(expected.signals) == set(record.signals)
        for address, signal in expected.signals.items():
            assert record[address].dtype == signal.dtype
            np.testing.assert_allclose(record[address][row], signal[0], tolerance, tolerance, err_msg=address)
            np.testing.assert_array_equal(record.times(address), expected.times(address))
        if state is not None:
            same(jax.tree.map(lambda x, row=row: x[row : row + 1], state["blocks"]), slow.state["blocks"], tolerance)
            same(jax.tree.map(lambda x, row=row: x[row : row + 1], state["hosts"]), slow.state["hosts"], tolerance)
    return run


def same(one: Any, other: Any, tolerance: float = 0.0) -> None:
    """See that two trees have the same structure, shapes, types and numbers."""
    assert jax.tree.structure(one) == jax.tree.structure(other)
    for a, b in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        assert np.shape(a) == np.shape(b)
        if np.asarray(a).dtype.kind == "S":  # what is saved as bytes is not alike in its numbers only
            continue
        assert np.asarray(a).dtype == np.asarray(b).dtype
        np.testing.assert_allclose(a, b, tolerance, tolerance)


def leak(rate: float = 2.0) -> Diagram:
    """A leaky integrator as a subsystem: its inlet `u`, its outlet `y`."""
    diagram = Diagram()
    diagram.add("u", Inlet(0.5))
    diagram.add("error", Sum("+-"))
    diagram.add("rate", Gain(rate))
    diagram.add("level", Integrator(0.1))
    diagram.add("y", Outlet())
    wire(diagram, "u error.u1", "level error.u2", "error rate", "rate level", "level y")
    return diagram


def wire(diagram: Diagram, *wires: str) -> Diagram:
    """Connect, each wire given as `"source target"`."""
    for each in wires:
        diagram.connect(*each.split(" "))
    return diagram
