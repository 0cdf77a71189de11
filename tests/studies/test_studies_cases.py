"""Cases, settings that belong to some tasks only; and measures beside the mean over the last records."""

import shutil

import numpy as np
import pytest
from study_examples import small

import motorgrad as mg
from motorgrad.studies import Study, _partition

CASES = [
    {"task": "three-state", "agent": {"learning_rate": [0.01, 0.1]}},
    {"task": "three-state", "agent": {"learning_rate": 0.1}},  # again
    {"task": {"name": "three-state"}, "agent": {"decay": 0.5}, "steps": 200, "window": 50},
]


@pytest.fixture(scope="module")
def done(tmp_path_factory):
    study = Study(
        cases=CASES, steps=400, seeds=2, window=100, measures=("online", "frozen", "frozen-mode"), evaluate=50
    )
    return study.run(tmp_path_factory.mktemp("cases") / "study", progress=False)


@pytest.mark.ci
def test_cases_have_settings_and_steps_of_their_own(done, tmp_path):
    assert [point["agent"] for point in done.study.points] == [
        {"learning_rate": 0.01},
        {"learning_rate": 0.1},
        {"decay": 0.5},
    ]
    assert [(job.steps, job.window) for job in done.study.jobs] == [(400, 100), (200, 50)]
    assert done.table["decision"].to_pylist() == [400] * 4 + [200] * 2
    assert Study.read(done.path / "study.toml") == done.study


@pytest.mark.ci
def test_the_measures_are_means_of_the_same_runs(done):
    for point in range(3):
        run = done.run(point)
        np.testing.assert_allclose(done.values("reward")[point], run.final("reward", 0.1))
        np.testing.assert_allclose(done.values("reward_online")[point], run.final("reward", 1.0))
    job = done.study.jobs[0]
    drawn, likely = (mg.evaluate(done.path / "jobs" / job.name, 50, mode=mode).reward for mode in ("sample", "mode"))
    for name, wanted in (("reward_frozen", drawn), ("reward_frozen_mode", likely)):
        np.testing.assert_array_equal(done.values(name)[list(job.points)].ravel(), wanted.astype(float))
    assert (drawn != likely).any()


def test_a_job_killed_before_its_evaluation_makes_it_again(tmp_path, monkeypatch):
    study = small(agent={"learning_rate": [0.01, 0.1]}, lanes=2, measures=("frozen",), evaluate=20)
    done = study.run(tmp_path / "done", progress=False)
    shutil.copytree(done.path, tmp_path / "study")
    (frozen,) = (tmp_path / "study").glob("jobs/0001-*/frozen.npz")
    frozen.unlink()
    (tmp_path / "study" / "index.parquet").unlink()
    assert not Study.load(tmp_path / "study").complete
    trained = []
    train = _partition.train
    monkeypatch.setattr(_partition, "train", lambda *a, **k: trained.append(a[4].name) or train(*a, **k))
    again = done.study.run(tmp_path / "study", progress=False)
    assert trained == [done.study.jobs[1].name]
    for name in done.table.column_names:
        np.testing.assert_array_equal(again.table[name].to_numpy(), done.table[name].to_numpy(), err_msg=name)


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"cases": []}, "cases = []: must be a list of tables"),
        ({"cases": [{"task": "chain", "agnt": {}}]}, "did you mean 'agent'"),
        ({"cases": [{"task": "chian"}]}, "did you mean 'chain'"),
        ({"cases": [{"agent": {}}]}, "task = None: must be the name of a task"),
        ({"cases": [{"task": "chain", "steps": 0}]}, "cases.steps = 0"),
        ({"cases": CASES, "task": "chain"}, "task = 'chain': must be left out"),
        ({"cases": CASES, "measures": ["frozne"]}, "did you mean 'frozen'"),
        ({"cases": CASES, "evaluate": 0}, "evaluate = 0"),
    ],
)
def test_impossible_cases_are_refused(changes, said):
    with pytest.raises(ValueError, match=said.replace("[", r"\[").replace("]", r"\]")):
        Study(**changes)


def test_a_study_without_measures_is_as_it_was():
    assert set(small().as_table()) == {"task", "agent", "steps", "seeds", "window", "lanes"}
    assert mg.agent_for("chain", {"preset": "natural"}) == mg.agent_for("chain", preset="natural")
