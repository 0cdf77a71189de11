"""What the tests of studies share: small studies, and exact comparison of the folders that they leave."""

import json
import time

import numpy as np
import pyarrow.compute as pc
import tomli_w

from motorgrad.studies import Results, Study, run_study
from motorgrad.training import load
from motorgrad.training.store._checkpoint import load as read_checkpoint


def small(**changes):
    """Two compiled programs; the settings of each in two calls."""
    given = {
        "task": "three-state",
        "agent": {"learning_rate": [0.001, 0.01, 0.1, 0.2], "baseline": ["mean", "none"]},
        "steps": 400,
        "seeds": 2,
        "window": 100,
        "lanes": 4,
    }
    return Study(**(given | changes))


def arrays(job, folder):
    """All numbers that a job left in its run directory, but wall time."""
    path = folder / "jobs" / job.name
    run = load(path)
    columns = {
        name: run.metrics[name].combine_chunks().to_pylist()
        for name in run.metrics.column_names
        if name not in ("wall_time", "cpu_time")
    }
    found, about = read_checkpoint(max((path / "checkpoint").glob("[0-9]*.state")))
    return run.config, about["decision"], columns, found


def assert_same_study(found, wanted):
    """Two folders of the same study hold the same numbers, bit for bit."""
    found, wanted = Results.load(found), Results.load(wanted)
    assert found.study == wanted.study
    assert found.complete
    assert wanted.complete
    for job in wanted.study.jobs:
        (config, decision, columns, ours), (*others, theirs) = arrays(job, found.path), arrays(job, wanted.path)
        # as text, which is exact, and in which NaN equals NaN
        assert json.dumps([config, decision, columns]) == json.dumps(others)
        assert ours.keys() == theirs.keys()
        for name, array in ours.items():
            np.testing.assert_array_equal(array, theirs[name], err_msg=name)
    for name in wanted.table.column_names:
        np.testing.assert_array_equal(found.table[name].to_numpy(), wanted.table[name].to_numpy(), err_msg=name)


def checkpoints(folder):
    """The checkpoints of all jobs."""
    return sorted(file.parent.parent.name + file.stem for file in folder.glob("jobs/*/checkpoint/0*.state"))


def wait_for(condition, seconds=600):
    """Wait until something has happened."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def failing_study(folder, **where):
    """A study with a job that fails wherever it runs: something else is in its run directory."""
    study = small(lanes=100)
    (folder / "jobs" / study.jobs[1].name).mkdir(parents=True)
    (folder / "study.toml").write_text(tomli_w.dumps(study.as_table()))
    (folder / "jobs" / study.jobs[1].name / "letter.txt").write_text("dear")
    results = run_study(study, folder, attempts=2, progress=False, **where)
    assert pc.unique(results.table["status"]).to_pylist() == ["done", "failed"]
    return results
