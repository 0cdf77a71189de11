"""What is compiled, and how often; and that long work takes no more memory than short work."""

import gc
import tracemalloc

import jax
import numpy as np
import pytest

from lab_examples import Ticker
from test_lab_engine_run import hosted, mixed
from timlab import Run, UnitDelay
from timlab.compiler import _program


def edited():
    """The mixed diagram with another parameter, under another name."""
    diagram = mixed()
    diagram.replace("gain", type(diagram.nodes["gain"].block)(0.1))
    diagram.rename("gain", "factor")
    return diagram


def test_a_diagram_with_other_parameters_and_names_is_not_compiled_again():
    one = Run(mixed(), seeds=2)
    first = one.advance(5)["level.u"]
    other = Run(edited(), seeds=[7, 8])
    assert other._loop is one._loop
    second = other.advance(5)["level.u"]
    assert other.compilations == 1
    assert not np.array_equal(first, second)


@pytest.mark.ci  # test_lab_engine_cache compares programs that are shared with those of each diagram alone
def test_a_diagram_gives_with_the_program_of_another_what_it_gives_with_its_own():
    one, other = Run(mixed(), seeds=2), Run(edited(), seeds=[7, 8])
    assert other._loop is one._loop
    second = other.advance(5)["level.u"]
    _program._kept.clear()
    alone = Run(edited(), seeds=[7, 8])
    assert alone._loop is not one._loop
    np.testing.assert_array_equal(second, alone.advance(5)["level.u"])


@pytest.mark.parametrize(
    "edit",
    [
        lambda diagram: diagram.replace("slow", UnitDelay(0.5, (2,), every=2)),
        lambda diagram: diagram.remove("slow seen"),
        lambda diagram: setattr(diagram, "tick", 0.2),
        lambda diagram: setattr(diagram, "substeps", 2),
        lambda diagram: diagram.disconnect("leak.u"),
        lambda diagram: diagram.nodes.update(dice=type(diagram.nodes["dice"])(diagram.nodes["dice"].block, "other")),
    ],
)
def test_another_structure_is_another_program(edit):
    one, diagram = Run(mixed()), mixed()
    edit(diagram)
    assert Run(diagram)._loop is not one._loop


def test_other_numbers_of_seeds_and_swept_parameters_are_other_programs():
    one = Run(mixed())
    assert Run(mixed(), seeds=2)._loop is not one._loop
    assert Run(mixed(), seeds=1, sweep={"gain.gain": [1.0]})._loop is not one._loop


def test_hosts_begin_with_the_parameters_as_they_stand():
    seen = []

    class Noting(Ticker):
        def start(self, seeds, uniforms, threads=0):
            seen.append(float(self.factor))
            return super().start(seeds, uniforms, threads)

    diagram = hosted()
    diagram.replace("host", Noting(0.25))
    run = Run(diagram)
    run["host.factor"] = 0.75
    run.reset()
    diagram.replace("host", Noting(2.0))
    assert Run(diagram)._loop is run._loop
    assert seen == [0.25, 0.75, 2.0]


def test_a_host_without_feedthrough_makes_a_tick_one_call():
    assert len(Run(hosted())._loop._calls) == 1


@pytest.mark.ci
@pytest.mark.parametrize("make", [mixed, pytest.param(hosted, marks=pytest.mark.slow)])
def test_running_and_retuning_for_long_takes_no_more_memory(make):
    address = "gain.gain" if make is mixed else "host.factor"
    run, rng = Run(make(), seeds=4), np.random.default_rng(0)

    def work(times):
        for _ in range(times):
            run[address] = rng.uniform(-0.5, 0.5)
            run.advance(int(rng.integers(1, 40)))
            run.restore(run.fork().state)
        gc.collect()
        return sum(array.nbytes for array in jax.live_arrays()), tracemalloc.get_traced_memory()[0]

    tracemalloc.start()
    try:
        work(20)
        before = work(20)
        after = work(60)
    finally:
        tracemalloc.stop()
    assert after[0] <= before[0] + 4096
    assert after[1] <= before[1] + 200_000
    assert run.compilations == 1
    assert np.all(np.isfinite(run.advance(5)["level.u"]))
