"""The speed table: that what is measured is what it says, and that the hand-written loop is the same learner."""

import importlib.util
import json
import time

import numpy as np
import pytest

from motorgrad.benchmarks import Row
from motorgrad.benchmarks._bodies import body_row, simulated_row, tendon_rows
from motorgrad.benchmarks._learners import hand_written
from motorgrad.benchmarks._loops import recruitment_loop, three_state_loop
from motorgrad.benchmarks._measure import in_turn
from motorgrad.cli import main
from motorgrad.policies import Softmax
from motorgrad.schema import numbers_of
from motorgrad.tasks import FallingParticle, HexapodSynergy, Hopper, LinearRecruitment, ThreeState
from motorgrad.training import agent_for, train
from motorgrad.worlds import oracle


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_ratios_are_of_pairs_measured_in_turn():
    calls = []

    def work(name, seconds):
        calls.append(name)
        time.sleep(seconds)

    row = in_turn("n", "u/s", 10, lambda: work("ours", 0.03), lambda: work("other", 0.01), 5, pairs=3, wanted="≥ 0.1")
    assert calls == ["ours", "other"] * 3
    # ten in 0.03 s or more against five in 0.01 s or more: a busy machine sleeps longer
    assert 0 < row.ours <= 10 / 0.03
    assert 0 < row.other <= 5 / 0.01
    assert row.spread[0] <= row.ratio <= row.spread[1]
    assert (row.name, row.unit, row.wanted) == ("n", "u/s", "≥ 0.1")


@pytest.mark.ci
@pytest.mark.parametrize("task", [Hopper(), HexapodSynergy()], ids=lambda task: task.name)
def test_the_rows_of_bodies_compare_learning_with_replayed_physics(task):
    row = body_row("a body", task, 2, 20, pairs=2)
    assert row.unit == "physics steps/s"
    assert 0 < row.spread[0] <= row.ratio <= row.spread[1]
    simulated = simulated_row(row, task)
    assert simulated.ours == pytest.approx(row.ours * task.dynamics.timestep)
    assert simulated.unit == "simulated s/s"


@pytest.mark.ci
def test_the_rows_of_tendons_compare_muscles_of_one_body():
    rows = list(tendon_rows(1, 3, 1))
    bodies = 2 + (importlib.util.find_spec("myosuite") is not None)
    assert [row.wanted for row in rows] == ["≥ 0.77", ""] * 2 * bodies
    assert all(row.ours > 0 and row.ratio > 0 for row in rows)
    assert rows[4].name == "hopper, muscles on compliant tendons ÷ on rigid ones, 1 seed"
    assert rows[6].name == "hopper, muscles with Millard's curves on compliant tendons ÷ on rigid ones, 1 seed"


@pytest.mark.ci
def test_the_hand_written_loop_learns_the_best_policy():
    world = ThreeState().dynamics
    inputs = (world.observations.astype(np.float32), world._cumulative.astype(np.float32), world._successors)
    weights, mean = three_state_loop(2_000_000, 1, *inputs, world.rewards.astype(np.float32), 0.8, 0.01)
    assert oracle.average_reward(world, Softmax(weights.astype(float))) > 0.79
    assert 0.6 < mean < 0.8


@pytest.mark.ci
def test_the_recruitment_loop_learns_as_the_library_does():
    task, decisions, seeds = LinearRecruitment(units=2), 100_000, 20
    rate = numbers_of(agent_for(task).hyperparameters)["optimizer.learning_rate"]
    loops = [recruitment_loop(decisions, seed, 2, task.slope, task.intercept, rate) for seed in range(seeds)]
    run = train(task, steps=decisions, seeds=seeds, progress=False)
    gains, errors = np.array([loop[1].mean() for loop in loops]), np.array([loop[3] for loop in loops])
    ours = np.asarray(run.policies.gain).mean(1), run.curve("error")[1].mean(1)
    for found, expected in zip((gains, errors), ours, strict=True):
        noise = np.hypot(found.std(ddof=1), expected.std(ddof=1)) / np.sqrt(seeds)
        assert abs(found.mean() - expected.mean()) < 4 * noise
    assert gains.mean() > 1  # something was learned


@pytest.mark.slow
def test_the_particle_loop_learns_as_the_library_does():
    decisions, seeds = 40_000, 20
    loops = [hand_written(FallingParticle(), seed)(decisions) for seed in range(seeds)]
    run = train("particle", steps=decisions, seeds=seeds, progress=False)
    widths, rewards = np.array([loop[1].mean() for loop in loops]), np.array([loop[2] for loop in loops])
    ours = np.asarray(run.policies.log_width).mean((1, 2)), run.curve("reward")[1].mean(1)
    for found, expected in zip((widths, rewards), ours, strict=True):
        noise = np.hypot(found.std(ddof=1), expected.std(ddof=1)) / np.sqrt(seeds)
        assert abs(found.mean() - expected.mean()) < 4 * noise
    assert rewards.mean() > 0.15  # something was learned


@pytest.mark.slow
def test_bench_measures_every_row(tmp_path, capsys):
    assert main(["bench", "--quick", "--json", "bench.json"]) == 0
    said = capsys.readouterr().out
    found = json.loads((tmp_path / "bench.json").read_text())
    assert found["machine"]["processor"]
    rows = [Row(**row) for row in found["rows"]]
    for wanted in (
        "hopper, learning ÷ bare physics, 16 seeds",
        "three-state OLGARB ÷ compiled loop, 1 seed",
        "three-state OLGARB, sweep of 10 settings × 16 seeds ÷ one setting, 160 seeds",
        "linear recruitment of 8, OLGARB ÷ compiled loop, 1,024 seeds",
        "natural ÷ plain step",
        "particle with 8 local units, OLGARB ÷ compiled loop, 1 seed",
        "particle, 20 seeds × 20 episodes, with compilation",
        "memory of a seed",
        "indexed ÷ all",
        "import motorgrad",
        "peak memory",
        "apex",
    ):
        assert any(wanted in row.name for row in rows)
    for row in rows:
        assert row.name in said
        assert row.ours is None or row.ours > 0
