"""The experiments on 24 muscles: each from end to end at its smoke size, and how claims are judged."""

import dataclasses

import jax
import numpy as np
import pytest

from motorgrad.tasks import Hexapod, synergy_matrix
from motorgrad.training import agent_table
from motorgrad_thesis import EXPERIMENTS
from motorgrad_thesis.chapter_5.extensions._muscle_study import FULL, VARIANTS
from motorgrad_thesis.chapter_5.extensions.beyond_5_3_4_muscles import ablation_claims, muscle_claims

CLAIMED = {"beyond-5.3.4-muscles": 6, "beyond-5.3.4-proprioception": 3, "beyond-5.4.1-synergies": 3}
MUSCLES, PROPRIOCEPTION, SYNERGIES = (EXPERIMENTS[name] for name in CLAIMED)


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo notes divergences in the working directory


@pytest.mark.slow
@pytest.mark.parametrize("name", CLAIMED)
def test_each_leaves_a_figure_and_its_claims(name, done, check_complete):
    found = done(name)
    check_complete(name, found)
    assert len(found.claims) == CLAIMED[name]


@pytest.mark.slow
def test_synergies_are_found_in_the_run_of_the_unchanged_learner(out, done):
    for name in CLAIMED:
        done(name)
    names = [run.name for run in (out / "trained").glob("[!.]*")]
    shared = [
        name for name in names if name.startswith("hexapod-") and "synergy" not in name and "proprioception" not in name
    ]
    assert len(shared) == 3  # the unchanged learner, and two that are changed


def test_they_stand_in_the_order_of_the_source():
    assert [name for name in EXPERIMENTS if name in CLAIMED] == list(CLAIMED)


@pytest.mark.parametrize(
    ("kind", "setting", "named"),
    [
        (MUSCLES, {"updates": 0}, "updates = 0"),
        (MUSCLES, {"seeds": 1}, "seeds = 1"),
        (MUSCLES, {"watched": 30.0}, "watched = 30"),
        (MUSCLES, {"compared": 11}, "compared = 11"),
        (MUSCLES, {"variants": ("no muscles",)}, "no muscles"),
        (MUSCLES, {"variants": (FULL,)}, r"unknown variants\[0\] "),
        (PROPRIOCEPTION, {"watched": 30.0}, "watched = 30"),
        (SYNERGIES, {"gaits": 11}, "gaits = 11"),
        (SYNERGIES, {"learners": 1}, "learners = 1"),
        (SYNERGIES, {"seconds": 0.0}, "seconds = 0"),
        (SYNERGIES, {"lag": -1}, "lag = -1"),
    ],
)
def test_what_cannot_be_is_refused(kind, setting, named):
    with pytest.raises(ValueError, match=named):
        kind(**setting)


def test_nothing_is_given_to_the_learner_and_one_thing_is_changed_in_each_other():
    study = MUSCLES()
    task = study.task()
    assert (task.drives, task.action_size) == (None, 24)
    full = study.learner(FULL)
    assert full == study.learner()
    weights = full.policy(jax.random.key(0)).weights
    assert weights.shape == (24, 20)
    assert not np.any(weights)
    assert study.updates * full.estimator.update_every * task.period <= 4000
    own = agent_table(full)
    for variant in VARIANTS:
        changes, table = VARIANTS[variant][1], agent_table(study.learner(variant))
        paths = {"damping": "metric", "learning_rate": "optimizer", "baseline": "estimator"}
        assert {name for name in table if table[name] != own[name]} == {paths.get(name, name) for name in changes}
        assert (study.task(variant) != task) == bool(VARIANTS[variant][0])


def test_with_all_senses_no_gait_and_no_synergies_are_given():
    study = PROPRIOCEPTION()
    task, policy = study.task(), study.learner().policy(jax.random.key(0))
    assert (task.name, task.drives, task.action_size, task.time_limit) == ("hexapod-proprioception", None, 24, 8.0)
    assert (study.updates, study.seeds, study.first_seed) == (study.learner().metric.kl.steps, 50, 50)
    assert policy.pool.pool.weights.shape == (12, task.observation_size + 64)
    assert not np.any(policy.pool.pool.weights)


def test_with_all_senses_training_has_episodes_and_the_judged_walks_have_none(monkeypatch):
    class Trained:
        def curve(self, quantity, **options):
            return np.zeros(1), np.zeros((2, 1))

        def with_task(self, task):
            return task

    monkeypatch.setattr(PROPRIOCEPTION, "trained", lambda self, work: Trained())
    monkeypatch.setattr(PROPRIOCEPTION, "judged", lambda self, work, task: {"judged in": task})
    study = PROPRIOCEPTION()
    assert study.run(None)["judged in"] == dataclasses.replace(study.task(), time_limit=None)


@pytest.mark.ci
def test_schedules_end_with_the_updates():
    short, full = MUSCLES(updates=600).learner(), MUSCLES().learner()
    assert (short.estimator.entropy.steps, short.metric.kl.steps) == (600, 600)
    assert (full.estimator.entropy.steps, full.metric.kl.steps) == (1200, 1200)
    assert short.averaging.start / 600 == full.averaging.start / 1200


def made_up(net=1.9, speed=2.0, stalls=0.0, ablated=1.0, seeds=10):
    values = {"variants": np.array(list(VARIANTS)[1:]), "compared": np.array(5)}
    spread = np.linspace(-0.05, 0.05, seeds)
    for variant in VARIANTS:
        for mode in ("mode", "sample"):
            middle = net if variant == FULL else ablated
            values[f"{variant} {mode} net"] = middle + spread
            values[f"{variant} {mode} speed"] = speed + spread
            values[f"{variant} {mode} stalls"] = np.where(np.arange(seeds) == 0, stalls, 0.0)
            values[f"{variant} {mode} falls"] = np.zeros(seeds)
            values[f"{variant} {mode} gait"] = np.array(["tripod"] * seeds)
        if variant != FULL:
            for name in ("net", "speed", "stalls", "falls", "gait"):
                for mode in ("mode", "sample"):
                    key = f"{variant} {mode} {name}"
                    values[key] = values[key][:5]
    return values


@pytest.mark.parametrize(
    ("changes", "holds"),
    [
        ({}, [False, True, True, True]),
        ({"net": 1.5}, [False, True, False, True]),
        ({"speed": 1.7}, [False, False, True, True]),
        ({"stalls": 0.05}, [False, True, True, False]),
        ({"net": 0.02, "speed": 0.03, "stalls": 1.0}, [True, False, False, False]),
    ],
)
def test_claims_about_the_learner(changes, holds):
    assert [claim.holds for claim in muscle_claims(made_up(**changes))] == holds


@pytest.mark.parametrize(("ablated", "holds"), [(1.0, [False] + [True] * 4), (2.5, [True] + [False] * 4)])
def test_claims_about_changed_learners(ablated, holds):
    values = made_up(ablated=ablated)
    assert [claim.holds for claim in ablation_claims(values)] == holds


def test_muscles_drawn_by_lot_keep_the_sizes_of_synergies():
    groups = Hexapod().body.groups
    lot = dict(zip(groups, np.random.default_rng(0).permutation(groups), strict=True))
    words = ("levator_left_front depressor_right_rear", "retractor_left_middle")
    mixed = [" ".join(str(lot[name]) for name in unit.split()) for unit in words]
    sizes = [synergy_matrix(each, groups).sum(1).tolist() for each in (words, mixed)]
    assert sizes[0] == sizes[1]


def test_claims_about_synergies():
    study = SYNERGIES()
    values = {"controller speed": np.array([0.52]), "explained": np.array([0.7, 0.71, 0.72, 0.73, 0.74])}
    spread = np.linspace(-0.1, 0.1, 20)
    for kind, level in (("found", 1.5), ("by lot", 0.1), ("by hand", 1.8)):
        for mode in ("mode", "sample"):
            values |= {f"{kind} {mode} {name}": level + spread for name in ("speed", "net")}
    assert [claim.holds for claim in study.claims(values)] == [True, True, True]
    values |= {f"by lot {mode} net": 1.5 + spread[::-1] for mode in ("mode", "sample")}
    values |= {"found sample speed": 0.5 + spread, "explained": np.array([0.3, 0.4, 0.35, 0.3, 0.42])}
    assert [claim.holds for claim in study.claims(values)] == [False, False, False]


@pytest.mark.parametrize(
    ("changes", "holds"),
    [
        ({"speed": 3.2, "net": 2.7}, [True, True, True]),
        ({"speed": 2.8, "net": 2.7}, [False, True, True]),
        ({"speed": 3.2, "net": 2.3}, [True, False, True]),
        ({"speed": 3.2, "net": 2.7, "stalls": 0.02}, [True, True, False]),
    ],
)
def test_claims_with_all_senses(changes, holds):
    assert [claim.holds for claim in PROPRIOCEPTION().claims(made_up(**changes))] == holds
