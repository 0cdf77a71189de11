"""Compiled programs are shared between runs: what a diagram gives does not depend on what ran before it."""

import dataclasses
import random

import numpy as np
import pytest

from lab_examples import Dice, Ticker, leak, outputs, wire
from timlab import (
    Block,
    Constant,
    DataFile,
    Diagram,
    DiscreteLag,
    Gain,
    Integrator,
    Lag,
    NormalNoise,
    Pulse,
    Record,
    Relay,
    Run,
    Sine,
    Step,
    Sum,
    UnitDelay,
)
from timlab.compiler import _program
from timlab.editor._program import signature

TICK = 0.01
TICKS = 24
SCHEDULES = [{}, {"period": TICK}, {"every": 2}, {"period": 2 * TICK}, {"period": 3 * TICK}]


def step_into_integrator(**schedule) -> Diagram:
    diagram = Diagram(TICK)
    diagram.add("step", Step(at=0.105, **schedule))
    diagram.add("level", Integrator())
    return wire(diagram, "step level")


def random_diagram(rng: random.Random, host: bool) -> Diagram:
    """A few sources, and blocks that read from what stands before them."""
    number = lambda: rng.uniform(-0.9, 0.9)  # noqa: E731
    sources = (
        lambda: Step(at=round(rng.uniform(0.02, 0.2), 2)),
        lambda: Sine(frequency=rng.uniform(1, 20)),
        lambda: Pulse(frequency=rng.uniform(1, 20)),
        lambda: NormalNoise(per=rng.choice(["sample", "root second"])),
    )
    readers = (
        lambda: Gain(number()),
        lambda: Sum("+-"),
        lambda: Integrator(number()),
        lambda: Lag(rng.uniform(0.05, 0.5)),
        lambda: DiscreteLag(rng.uniform(0.05, 0.5)),
        lambda: UnitDelay(number()),
        lambda: Relay(-0.2, 0.2),
        lambda: leak(abs(number())),
    )
    diagram = Diagram(TICK, substeps=rng.choice([1, 2]))
    for place in range(2):
        diagram.add(f"source {place}", rng.choice(sources)())
    for place in range(rng.randint(1, 3)):
        diagram.add(f"block {place}", rng.choice(readers)())
    if host:
        diagram.add("host", Ticker(number()))
    names = list(diagram.nodes)
    for place, name in enumerate(names):
        for port in diagram.nodes[name].block.inputs:
            found = [n for n in names[:place] if "y" in diagram.nodes[n].block.outputs]
            if found and diagram.nodes[name].block.inputs[port].shape == ():
                diagram.connect(f"{rng.choice(found)}.y", f"{name}.{port}")
    diagram.add("level", Integrator())  # shows what moves within a tick
    diagram.connect("source 0.y", "level.u")
    return diagram


def altered(diagram: Diagram, rng: random.Random) -> Diagram:
    """The same wires with other schedules, or other numbers, of some blocks.

    In two pairs of three the only schedule is a period of one tick, which changes how a block is evaluated and nothing
    else.
    """
    other, schedules = diagram.copy(), rng.choice([SCHEDULES, [{"period": TICK}], [{"period": TICK}]])
    for name, node in diagram.nodes.items():
        block = node.block
        if not isinstance(block, Block) or rng.random() < 0.3:
            continue
        if isinstance(block, Gain | Constant) and rng.random() < 0.3:
            field = "gain" if isinstance(block, Gain) else "value"
            other.replace(name, dataclasses.replace(block, **{field: rng.uniform(-0.9, 0.9)}))
        elif not block.is_continuous:
            other.replace(name, dataclasses.replace(block, **rng.choice(schedules)))
    return other


def record_of(diagram: Diagram) -> Record:
    return Run(diagram, seeds=[2, 5], watch=outputs(diagram)).advance(TICKS)


def assert_same(one: Record, other: Record) -> None:
    assert one.signals.keys() == other.signals.keys()
    for address, signal in one.signals.items():
        np.testing.assert_array_equal(signal, other.signals[address], err_msg=address)


def assert_independent(first: Diagram, second: Diagram) -> None:
    """Each gives, bit for bit, with nothing compiled before it what it gives after the other."""
    _program._kept.clear()
    alone = record_of(first)
    after = record_of(second)
    _program._kept.clear()
    assert_same(after, record_of(second))
    assert_same(alone, record_of(first))


def test_a_sample_period_of_one_tick_is_not_taken_for_none():
    continuous, sampled = step_into_integrator(), step_into_integrator(period=TICK)
    assert_independent(continuous, sampled)
    # integration is split at a jump within the tick; a held source jumps at the next tick
    within, held = (record_of(diagram)["level.y"][0, 11] for diagram in (continuous, sampled))
    np.testing.assert_allclose((within, held), (TICK / 2, 0.0), atol=1e-8)


def test_the_editor_compiles_again_for_a_sample_period_of_one_tick():
    assert signature(step_into_integrator()) != signature(step_into_integrator(period=TICK))
    assert signature(step_into_integrator()) == signature(step_into_integrator())


@pytest.mark.ci
def test_a_timed_file_with_a_sample_period_of_one_tick_is_not_taken_for_one_without(tmp_path):
    path = tmp_path / "steps.csv"
    path.write_text("t,y\n0,0\n0.105,1\n")
    pair = []
    for schedule in ({}, {"period": TICK}):
        diagram = Diagram(TICK)
        diagram.add("file", DataFile(str(path), time="t", **schedule))
        diagram.add("level", Integrator())
        pair.append(wire(diagram, "file level"))
    assert_independent(*pair)
    assert not np.array_equal(*(record_of(diagram)["level.y"] for diagram in pair))


@pytest.mark.ci
@pytest.mark.parametrize("seed", range(6))
def test_random_pairs_give_together_what_they_give_alone(seed):
    rng = random.Random(seed)
    first = random_diagram(rng, host=seed == 3)
    assert_independent(first, altered(first, rng))


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(100, 140))
def test_many_random_pairs_give_together_what_they_give_alone(seed):
    rng = random.Random(seed)
    first = random_diagram(rng, host=seed % 8 == 0)
    assert_independent(first, altered(first, rng))


@pytest.mark.ci
def test_random_numbers_are_those_of_each_diagram_whatever_ran_before():
    pair = []
    for size in (2, 3):
        diagram = Diagram(TICK)
        diagram.add("dice", Dice(size))
        diagram.add("gain", Gain(2.0, (size,)))
        pair.append(wire(diagram, "dice.y gain"))
    assert_independent(*pair)
