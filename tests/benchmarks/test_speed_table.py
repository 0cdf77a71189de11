"""The speed table: that what is measured is what it says, and that the hand-written loop is the same learner."""

import json
import re
import subprocess
import sys
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest

from motorgrad._extras import MissingExtra
from motorgrad.benchmarks import (
    Figures,
    Goal,
    Row,
    Took,
    _bodies,
    _measure,
    chosen,
    figures,
    in_turn,
    speed_table,
    timed,
)
from motorgrad.benchmarks._learners import hand_written
from motorgrad.benchmarks._loops import recruitment_loop, three_state_loop
from motorgrad.cli import main
from motorgrad.policies import Softmax
from motorgrad.schema import numbers_of
from motorgrad.tasks import FallingParticle, HexapodSynergy, Hopper, LinearRecruitment, ThreeState
from motorgrad.training import agent_for, train
from motorgrad.worlds import oracle


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def test_ratios_are_of_pairs_measured_in_turn_by_both_clocks(monkeypatch):
    clocks = {"wall": 0.0, "cpu": 0.0}
    monkeypatch.setattr(_measure, "time", SimpleNamespace(perf_counter=lambda: clocks["wall"]))
    monkeypatch.setattr(_measure, "_used", lambda: clocks["cpu"])
    calls = []

    def work(name, walls, cpu):
        calls.append(name)
        clocks["wall"] += walls.pop(0)
        clocks["cpu"] += cpu

    walls = {"ours": [2.0, 4.0, 5.0], "other": [1.0, 1.0, 1.0]}
    works = (lambda: work("ours", walls["ours"], 4.0), lambda: work("other", walls["other"], 0.5))
    found = in_turn("u/s", 20, *works, 5, 3)
    assert calls == ["ours", "other"] * 3
    assert (found.ours, found.other, found.ratio, found.spread) == (5.0, 5.0, 1.0, (0.8, 2.0))
    assert (found.cpu_ratio, found.cpu_spread) == (0.5, (0.5, 0.5))
    assert found.pairs[1] == (Took(20, 4.0, 4.0), Took(5, 1.0, 0.5))
    assert found.costs == [0.2] * 3


def test_seconds_have_no_ratio_and_memory_has_no_time():
    found = figures("s", [(Took(1, 3.0, 2.0), Took(1, 1.0, 1.0))])
    assert (found.ours, found.other, found.ratio, found.costs) == (3.0, 1.0, None, [2.0])
    assert Figures(0.5, None, "GB").costs == [0.5]


def test_processor_time_is_of_all_threads_and_of_children_and_not_of_waiting():
    burn = "import time\nwhile time.process_time() < 0.2: pass"

    def in_a_thread():
        thread = threading.Thread(target=exec, args=(burn.replace("0.2", str(time.process_time() + 0.2)),))
        thread.start()
        thread.join()

    assert timed(lambda: subprocess.run([sys.executable, "-S", "-c", burn], check=True)).cpu >= 0.2
    assert timed(in_a_thread).cpu >= 0.2
    slept = timed(lambda: time.sleep(0.2))
    assert slept.wall >= 0.2
    assert slept.cpu < slept.wall


@pytest.mark.parametrize(
    ("goal", "words", "ours", "ratio", "met"),
    [
        (Goal(0.8), "≥ 0.8", 1.0, 0.8, True),
        (Goal(0.8), "≥ 0.8", 1.0, 0.79, False),
        (Goal(10_000, "u/s"), "≥ 10,000 u/s", 9_000.0, 24.0, False),
        (Goal(9, "u/s", at_most=True), "≤ 9 u/s", 9.0, None, True),
    ],
)
def test_a_goal_says_whether_it_is_met(goal, words, ours, ratio, met):
    assert str(goal) == words
    assert goal.met(Figures(ours, None, "u/s", ratio)) == met


def test_a_goal_refuses_figures_that_lack_what_it_is_of():
    with pytest.raises(ValueError, match="a ratio for ≥"):
        Goal(0.8).met(Figures(1.0, None, "u/s"))
    with pytest.raises(ValueError, match="GB for ≤"):
        Goal(1.5, "GB", at_most=True).met(Figures(1.0, None, "s"))


def test_rows_are_asked_for_by_id_or_pattern():
    rows = list(speed_table())
    ids = [row.id for row in rows]
    assert len(set(ids)) == len(ids)
    assert all(re.fullmatch(r"[a-z0-9-]{3,32}", each) for each in ids)
    assert len({row.name for row in rows}) == len(rows)
    assert [row.id for row in chosen(rows, ["import", "three-states-*"])] == [
        *("three-states-1", "three-states-1024", "three-states-sweep", "import")
    ]
    assert [row.id for row in chosen(rows)] == ids
    with pytest.raises(ValueError, match="unknown row 'hoper-1': did you mean 'hopper-1'"):
        chosen(rows, ["hoper-1"])


def test_bench_lists_rows_and_refuses_unknown_ones(capsys):
    assert main(["bench", "--list", "--rows", "hopper-*"]) == 0
    listed = capsys.readouterr().out.splitlines()
    assert [line.split()[0] for line in listed] == ["hopper-16", "hopper-1"]
    assert listed[0].endswith("hopper, learning ÷ bare physics, 16 seeds   wanted ≥ 0.96")
    assert main(["bench", "--rows", "hoper-1"]) == 2


def test_bench_leaves_out_aloud_what_takes_long_or_needs_more(monkeypatch, capsys, tmp_path):
    def needs(quick, pairs):
        raise MissingExtra("this row needs the package far")

    rows = [
        Row("plain", "a row", lambda quick, pairs: Figures(float(pairs), None, "s"), Goal(1, "s", at_most=True)),
        Row("long", "a long row", lambda quick, pairs: Figures(1.0, None, "s"), quick=False),
        Row("far", "a row of far", needs),
    ]
    monkeypatch.setattr("motorgrad.commands.bench.speed_table", lambda: rows)
    assert main(["bench", "--quick", "--json", "bench.json"]) == 0
    said = capsys.readouterr().out
    assert "takes long: long" in said
    assert "left out, far: this row needs the package far" in said
    (row,) = json.loads((tmp_path / "bench.json").read_text())["rows"]
    assert (row["id"], row["ours"], row["wanted"], row["pairs"]) == ("plain", 2.0, "≤ 1 s", [])


@pytest.mark.ci
@pytest.mark.parametrize("task", [Hopper(), HexapodSynergy()], ids=lambda task: task.name)
def test_the_rows_of_bodies_compare_learning_with_replayed_physics(task):
    found = _bodies.body(task, 2, 20, pairs=2)
    assert found.unit == "physics steps/s"
    assert 0 < found.spread[0] <= found.ratio <= found.spread[1]
    assert 0 < found.cpu_spread[0] <= found.cpu_ratio <= found.cpu_spread[1]
    assert all(took.amount == 2 * 20 * task.substeps for pair in found.pairs for took in pair)
    assert found.also == f"{found.ours * task.dynamics.timestep:,.3g} simulated s/s, all seeds together"


@pytest.mark.ci
def test_the_rows_of_tendons_compare_muscles_of_one_body(monkeypatch):
    stepped = []
    monkeypatch.setattr(_bodies, "_stepped", lambda batch, actions: stepped.append(batch.body))
    for row in chosen(speed_table(), ["tendons-arm6-*"]):
        row.measure(True, 1)
    kinds = [(body.muscle_model, body.tendon, body.curves) for body in stepped]
    compliant, rigid = (("hill", tendon, "de-groote") for tendon in ("compliant", "rigid"))
    millard, both = (("hill", tendon, "millard") for tendon in ("compliant", "rigid"))
    assert kinds[0:2] == [compliant, rigid]
    assert kinds[2] == compliant
    assert kinds[3][0] != "hill"
    assert kinds[4:] == [millard, both, millard, compliant]


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
    measured = {row["id"] for row in found["rows"]}
    for row in speed_table():
        assert row.quick == (row.id in measured) or f"left out, {row.id}" in said
        assert row.id in said
    assert all(row["ours"] is None or row["ours"] > 0 for row in found["rows"])
