"""What the tests of training share: small runs of every task, and exact comparison of what they leave behind."""

import functools
import hashlib
import json

import jax
import numpy as np
import pytest

from motorgrad.tasks import TASKS, BodyTask
from motorgrad.training import agent_for, stepper_for
from motorgrad.training.store._checkpoint import load as read_checkpoint

TASK_NAMES = sorted(TASKS)
# A plain learner in place of the preset of Gymnasium environments, which takes three times as long to compile.
PLAIN = {
    "estimator": "olgarb",
    "normalization": "none",
    "entropy": "none",
    "metric": "none",
    "averaging": "none",
    "learning_rate": 0.01,
    "decay": 0.9,
}
NEVER = 1e9  # seconds between two checkpoints: one is made at the end alone, however slow the machine


def one_of_each_kind():
    """Every task as a parameter; slow but for the first on each engine with each kind of actions, and on a body with
    and without an end of its own."""
    kinds = {}
    for name in TASK_NAMES:
        on_body = issubclass(TASKS[name], BodyTask)
        kinds.setdefault((on_body, on_body and TASKS[name].episodic, TASKS[name].actions), name)
    return [name if name in kinds.values() else pytest.param(name, marks=pytest.mark.slow) for name in TASK_NAMES]


def learner(task, seeds, mode="learn", **changes):
    """The engine of a task (or of a task's name) with its own learner."""
    task = TASKS[task]() if isinstance(task, str) else task
    return stepper_for(task, agent_for(task, changes), seeds, mode, threads=1)


@functools.cache
def _learner(name, seeds, mode):
    stepper = learner(name, seeds, mode)
    return stepper, stepper.state


def reborn(name, seeds, mode="learn"):
    """The one engine of this kind, put back to its beginning: for tests that do not doubt `restore`."""
    stepper, start = _learner(name, tuple(seeds), mode)
    stepper.restore(start)
    return stepper


def assert_same(found, wanted):
    """Two trees are equal in structure and in every bit (NaN equals NaN)."""
    assert jax.tree.structure(found) == jax.tree.structure(wanted)
    jax.tree.map(np.testing.assert_array_equal, found, wanted)


def assert_differ(found, other):
    """Some number differs: a comparison with it could have failed."""
    pairs = zip(jax.tree.leaves(found), jax.tree.leaves(other), strict=True)
    assert not all(np.array_equal(a, b, equal_nan=True) for a, b in pairs if a.dtype.kind == "f")


def columns(table):
    """The columns of a run's metrics that the wall clock has no part in, as arrays."""
    table = table.combine_chunks()
    found = {
        name: table[name].to_numpy()
        for name in table.column_names
        if name not in ("wall_time", "cpu_time", "parameters")
    }
    parameters = table["parameters"].combine_chunks()
    return found | {"parameters": parameters.flatten().to_numpy().reshape(len(parameters), -1)}


def checkpoints(path):
    """The files of a run's complete states, oldest first."""
    return sorted((path / "checkpoint").glob("*.state"))


def final_state(path):
    """Every array of a run's newest checkpoint."""
    return read_checkpoint(checkpoints(path)[-1])[0]


def sign(path):
    """Give a run whose metrics were altered the checksums that it would have if it had been made so."""
    parts = sorted((path / "metrics").glob("*.parquet"))
    lines = "".join(f"{hashlib.sha256(part.read_bytes()).hexdigest()}  {part.name}\n" for part in parts)
    (path / "metrics" / "SHA256SUMS").write_text(lines)
    mark = {"length": len(lines), "checksum": hashlib.sha256(lines.encode()).hexdigest()}
    change_facts(checkpoints(path)[-1], lambda facts: facts.update(metrics=mark))


def change_facts(checkpoint, change):
    """Change the facts in a checkpoint, and its checksum with them, as a stranger can."""
    _, head, arrays = checkpoint.read_bytes().split(b"\n", 2)
    facts = json.loads(head)
    change(facts)
    body = json.dumps(facts).encode() + b"\n" + arrays
    checkpoint.write_bytes(hashlib.sha256(body).hexdigest().encode() + b"\n" + body)


def assert_same_run(found, wanted):
    """Two runs, loaded from their directories, are the same but for wall time: metrics, policies, complete state."""
    assert found.config == wanted.config
    assert found.complete
    assert found.decision == wanted.decision
    assert_same(columns(found.metrics), columns(wanted.metrics))
    assert_same(found.policies, wanted.policies)
    assert_same(found.initial, wanted.initial)
    assert_same(final_state(found.path), final_state(wanted.path))
