"""Studies of every kind of task: a JAX world, a MuJoCo body and a Gymnasium environment give the same numbers in one
process and in several of which some are killed."""

import multiprocessing
import threading

import pytest
from study_examples import assert_same_study, checkpoints, wait_for

from motorgrad.studies import Study

pytestmark = [pytest.mark.slow, pytest.mark.ci]


def test_every_kind_of_task_is_the_same_anywhere_and_whatever_is_killed(tmp_path):
    study = Study(
        task=["three-state", "hopper", {"name": "gymnasium", "env_id": "CartPole-v1"}],
        agent={"learning_rate": [1e-4, 1e-3]},
        steps=120,
        seeds=2,
        window=20,
    )
    wanted = study.run(tmp_path / "wanted", checkpoint_every=0.0, progress=False)
    folder, killed = tmp_path / "study", []

    def kill():
        for least in (1, 4):
            wait_for(lambda least=least: len(checkpoints(folder)) >= least)
            for child in multiprocessing.active_children()[:1]:
                child.kill()
                killed.append(child.pid)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    how = {"on": "processes", "workers": 2, "threads": 1, "checkpoint_every": 0.0}
    results = study.run(folder, progress=False, trust=True, **how)
    killer.join()
    assert killed
    assert {job.task["name"] for job in study.jobs} == {"three-state", "hopper", "gymnasium"}
    assert not results.failures
    assert_same_study(folder, wanted.path)
