"""The compiled form against the interpreter: the same block functions, one at a time."""

import dataclasses
import random
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from lab_examples import Chance, Dice, Scattered, Ticker, agree, leak, wire
from timlab import (
    BLOCKS,
    Block,
    Constant,
    Diagram,
    Gain,
    HillMuscle,
    HostBlock,
    Integrator,
    Sum,
    UnitDelay,
)


def default(kind: type[Block]) -> Block | None:
    """A block as it is by default; `None` where something must be given."""
    if kind is HillMuscle:
        return HillMuscle(max_isometric_force=1.0)  # single precision resolves a millionth of it
    needed = [f for f in dataclasses.fields(kind) if f.default is dataclasses.MISSING is f.default_factory]
    return None if needed else kind()


LATER = dict.fromkeys(("learning", "sinks"), pytest.mark.slow)  # take long to compile
# Compiled, these blocks are held against closed forms, NumPy and their tasks in tests/blocks and tests/worlds.
LATER |= dict.fromkeys(
    ("bodies and worlds", "dynamics", "logic", "mathematics", "nonlinear", "sources", "vectors"), pytest.mark.ci
)


def categories() -> list[Any]:
    """The categories of blocks; some are left to the long tests and to the share."""
    found = sorted({kind.category for kind in BLOCKS.values()})
    return [pytest.param(each, marks=LATER.get(each, ())) for each in found]


@pytest.mark.parametrize("category", categories())
def test_every_block_is_the_same_compiled(category):
    diagram = Diagram(tick=0.01)
    for name, kind in BLOCKS.items():
        block = default(kind)
        if kind.category != category or block is None:
            continue
        for number in (1, 2)[: 1 if isinstance(block, HostBlock) else 2]:  # two of a kind are one stack
            diagram.add(f"{name} {number}", block)
            for port, declared in block.inputs.items():
                # a tendon stretched by a meter pulls with 1e28 times its strength
                kind_of, scale = ("length", 0.25) if declared.unit == "m" else (declared.kind, 1.0)
                source = f"{kind_of} {declared.shape} {number}"  # other numbers for other blocks of a kind
                if source not in diagram.nodes:
                    diagram.add(source, Scattered(declared.shape, declared.kind, scale, number))
                diagram.connect(source, f"{name} {number}.{port}")
    agree(diagram, ticks=5, seeds=(3,))


def test_few_blocks_have_no_default():
    # they are tested where their examples are
    assert {name for name, kind in BLOCKS.items() if default(kind) is None} == {"data file", "fmu"}


def random_diagram(seed: int, size: int) -> Diagram:
    """Blocks of a few types at random rates, subsystems among them, wired at random without algebraic loops."""
    rng = random.Random(seed)
    diagram = Diagram(tick=rng.choice([0.01, 0.1]), substeps=rng.choice([1, 1, 3]))
    number = lambda: rng.uniform(-0.9, 0.9)  # noqa: E731
    made = (
        lambda: Constant(number()),
        lambda: Dice(),
        lambda: Gain(number(), every=rng.choice([1, 1, 2])),
        lambda: Sum(rng.choice(["+-", "++-"])),
        lambda: UnitDelay(number(), every=rng.choice([1, 2, 3])),
        lambda: Integrator(number()),
        lambda: leak(abs(number())),
    )
    diagram.add("first", Constant(1.0))
    for place in range(size):
        diagram.add(f"block {place}", rng.choice(made)())
    names = list(diagram.nodes)
    for place, name in enumerate(names):
        block = diagram.nodes[name].block
        for port, declared in block.inputs.items():
            late = isinstance(block, Block) and not declared.feedthrough
            sources = [
                f"{other}.{out}"
                for other in (names if late else names[:place])
                for out, given in diagram.nodes[other].block.outputs.items()
                if given.shape == declared.shape
            ]
            if isinstance(block, Block) or rng.random() < 0.7:  # a subsystem's inlet may stay open
                diagram.connect(rng.choice(sources), f"{name}.{port}")
    return diagram


def test_a_random_diagram_is_the_same_compiled():
    diagram = random_diagram(3, 8)
    blocks = {type(node.block).__name__ for node in diagram.nodes.values()}
    assert blocks == {"Constant", "Dice", "Gain", "Sum", "UnitDelay", "Integrator", "Diagram"}
    assert diagram.substeps == 3
    agree(diagram, ticks=7)


@pytest.mark.ci
@settings(max_examples=3, deadline=None, derandomize=True, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 10**6), size=st.integers(1, 14))
def test_random_diagrams_are_the_same_compiled(seed, size):
    agree(random_diagram(seed, size), ticks=7)


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])
@given(seed=st.integers(0, 10**9), size=st.integers(1, 40))
def test_many_random_diagrams_are_the_same_compiled(seed, size):
    agree(random_diagram(seed, size), ticks=7)


@pytest.mark.ci
@pytest.mark.representatives("3-False")  # the other host feeds through
@pytest.mark.parametrize("direct", [False, True])
@pytest.mark.parametrize("every", [1, 3])
def test_hosts_are_the_same_compiled(direct, every):
    diagram = Diagram()
    diagram.add("dice", Chance())
    diagram.add("host", Ticker(0.3, direct, every=every))
    diagram.add("other", Ticker(0.2, not direct))
    diagram.add("split", Chance((2,)))
    diagram.add("sum", Sum("++", (2,)))
    diagram.add("delay", UnitDelay(shape=(2,)))
    diagram.add("gain", Gain(2.0))
    wire(diagram, "dice gain", "gain host", "host sum.u1", "split sum.u2", "sum delay", "dice other")
    crosses = direct and every == 3  # a span of random numbers ends with tick 127
    run = agree(diagram, ticks=132 if crosses else 8, seeds=(4,) if crosses else (4, 1))
    assert run.compilations == 1


def test_numbers_that_differ_by_a_type_are_widened_along_a_wire():
    diagram = Diagram()
    diagram.add("yes", Scattered((3,), "bool"))
    diagram.add("gain", Gain(2.0, (3,)))
    diagram.connect("yes", "gain")
    run = agree(diagram)
    assert set(np.unique(run.advance(50)["gain.y"])) == {0.0, 2.0}
