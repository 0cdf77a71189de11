"""Every reader of strangers' files, under an audit hook: whatever is in a file, nothing runs, and nothing is written.

A file is refused with one of the product's own errors, or read. Wrong checksums are made right, as a stranger can.
"""

import dataclasses
import json
import pickle
import random
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest

import motorgrad as mg
from audit import mutations, nothing_happens, trap_module
from motorgrad.cli import main
from motorgrad.export._reader import read as read_exported
from motorgrad.lab.blocks._tables import read_columns
from motorgrad.sim.film._motion_file import read_motion
from motorgrad.sim.live._policy import load_policy, save_policy
from motorgrad.studies import Comparison, Study
from motorgrad.tasks.gymnasium._state import read_state, write_state
from motorgrad.training import NotTrusted, RunDirectoryError
from motorgrad.training.store._checkpoint import CorruptCheckpoint, checksum

COUNT = 60  # mutations of each file
REFUSALS = (ValueError, NotTrusted, RunDirectoryError, CorruptCheckpoint, OSError)


class Evil:
    def __reduce__(self) -> Any:
        return exec, ("raise SystemExit('a pickle was run')",)


class Harmless:
    def __reduce__(self) -> Any:
        return dict, ()


@dataclasses.dataclass
class Reader:
    """A kind of file: `make` writes a good one into a folder and returns it, `read` reads it."""

    make: Callable[[Path], Path]
    read: Callable[[Path], Any]


def written(name: str, content: str | bytes) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        file = folder / name
        file.write_bytes(content.encode() if isinstance(content, str) else content)
        return file

    return make


def command(*words: str) -> Callable[[Path], Any]:
    """A command that reads a file, as its answer."""

    def read(file: Path) -> int:
        try:
            return main([*words, str(file), "--check"])
        except SystemExit as ended:
            return int(ended.code or 0)

    return read


def archive(**arrays: Any) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        np.savez(folder / "file.npz", **arrays)
        return folder / "file.npz"

    return make


LEARNER = {"estimator": "olgarb", "metric": "none", "learning_rate": 0.01}


def run_in(folder: Path) -> Path:
    mg.train("gymnasium", LEARNER, steps=40, seeds=2, window=20, out=folder / "run", progress=False)
    return folder / "run"


def configuration_of_run(folder: Path) -> Path:
    return run_in(folder) / "config.toml"


def state_of_run(folder: Path) -> Path:
    return next((run_in(folder) / "checkpoint").glob("*.state"))


def with_right_checksum(file: Path) -> Any:
    """The run, whose state has been changed by somebody who knows how to make checksums."""
    _, _, body = file.read_bytes().partition(b"\n")
    file.write_bytes(checksum(body).encode() + b"\n" + body)
    return file


def policy_file(folder: Path) -> Path:
    save_policy(str(folder / "policy.npz"), mg.policies.hyperplanes(2, 3), "particle")
    return folder / "policy.npz"


def exported(folder: Path) -> Path:
    mg.policies.hyperplanes(2, 3).export(folder / "exported.npz")
    return folder / "exported.npz"


def call_exported(file: Path) -> None:
    """Whatever an exported policy computes, of zeros."""
    exported = read_exported(file)
    with np.load(file) as arrays:
        functions = json.loads(str(arrays["functions"]))
    for name, function in exported.items():
        inputs = functions[name][0]
        function(**{each: np.zeros(shape, dtype) for each, (_, shape, dtype) in inputs.items()})


def state_of_environment(folder: Path) -> Path:
    file = folder / "environment.json"
    file.write_bytes(write_state(made_environment()))
    return file


def made_environment() -> Any:
    environment = gymnasium.make("CartPole-v1")
    environment.reset(seed=1)
    return environment


def diagram(folder: Path) -> Path:
    mg.lab.save(mg.lab.example("ball"), folder / "ball.lab.json")
    return folder / "ball.lab.json"


TASK = 'env_id = "CartPole-v1"\nrepeat = 2\n'
AGENT = 'learning_rate = 0.01\n[agent.estimator]\nkind = "olgarb"\n'
MODEL = """<mujoco><worldbody><site name="o" pos="0 0 1"/><body name="a">
<joint name="j" type="hinge" axis="0 1 0" range="-90 90"/><geom size="0.1"/><site name="s" pos="0.2 0 0"/></body>
</worldbody><tendon><spatial name="t"><site site="s"/><site site="o"/></spatial></tendon>
<actuator><motor name="m" tendon="t"/></actuator></mujoco>"""
COMPARISON = """
metric = "reward"
steps = 400
seeds = { tune = 2, judge = 3 }
[tasks.cart]
task = { name = "gymnasium", env_id = "CartPole-v1" }
[methods.one]
estimator = "olgarb"
"""
READERS = {
    "configuration": Reader(
        written("c.toml", f'steps = 100\nseeds = 2\n[task]\nname = "gymnasium"\n{TASK}[agent]\n{AGENT}'),
        command("train", "--config"),
    ),
    "scene": Reader(written("s.toml", '[task]\nname = "hopper"\npenalty = 0.1\n'), command("sim", "--config")),
    "task": Reader(written("t.toml", f'name = "gymnasium"\n{TASK}'), mg.tasks.load),
    "study": Reader(
        written("study.toml", f'steps = 100\nseeds = 2\n[task]\nname = "gymnasium"\n{TASK}[agent]\n{AGENT}'), Study.read
    ),
    "comparison": Reader(
        written("comparison.toml", COMPARISON),
        Comparison.read,
    ),
    "configuration of a run": Reader(configuration_of_run, lambda file: mg.load(file.parent, allow_changed=True).task),
    "state of a run": Reader(state_of_run, lambda file: mg.load(file.parents[1]).policies),
    "policy": Reader(policy_file, lambda file: load_policy(file, mg.policies.hyperplanes(2, 3), "particle")),
    "state of an environment": Reader(
        state_of_environment, lambda file: read_state(file.read_bytes(), made_environment())
    ),
    "exported policy": Reader(exported, call_exported),
    "diagram": Reader(diagram, lambda file: mg.lab.load(file)),
    "model": Reader(written("m.xml", MODEL), lambda file: mg.bodies.Mjcf(str(file)).model),
    "table as text": Reader(
        written("t.csv", "time,a\n0,1\n1,2.5\n"), lambda file: read_columns(str(file), ("time", "a"))
    ),
    "table as arrays": Reader(
        archive(time=np.arange(3.0), a=np.arange(3.0)), lambda file: read_columns(str(file), ("time", "a"))
    ),
    "motion": Reader(
        written("m.csv", "time,j\n0,0\n0.1,0.2\n0.2,0.1\n"),
        lambda file: read_motion(file, mg.bodies.Mjcf(str(file.with_name("m.xml"))).model),
    ),
}


@pytest.fixture
def good(request, tmp_path, monkeypatch) -> tuple[Reader, Path]:
    """A reader and a good file of its kind, which it has read once."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    reader = READERS[request.param]
    written("m.xml", MODEL)(tmp_path)
    file = reader.make(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader.read(file)
    return reader, file


@pytest.mark.parametrize("good", READERS, indirect=True)
def test_whatever_is_in_a_file_nothing_happens(good, request, tmp_path, capsys):
    reader, file = good
    content, name = file.read_bytes(), trap_module(tmp_path)
    texts = [content.replace(b"CartPole-v1", each) for each in (b"os:system", f"{name}:X-v0".encode())]
    pickled = [pickle.dumps(Evil(), protocol) for protocol in (0, 2, 5)]
    chance = random.Random(request.node.name)
    refused = 0
    for changed in [*texts, *pickled, b"", b"\x80\x05", *mutations(content, COUNT, chance)]:
        file.write_bytes(changed)
        if file.suffix == ".state":
            with_right_checksum(file)
        with warnings.catch_warnings(), nothing_happens():
            warnings.simplefilter("ignore")
            try:
                refused += reader.read(file) == 2
            except REFUSALS:
                refused += 1
    assert refused
    capsys.readouterr()


def test_the_watch_sees_what_it_is_there_for(tmp_path):
    (tmp_path / "evil.pickle").write_bytes(pickle.dumps(Evil()))
    for act in (
        lambda: pickle.loads(pickle.dumps(Harmless())),
        lambda: (tmp_path / "new").write_text("x"),
        lambda: (tmp_path / "evil.pickle").unlink(),
        lambda: exec("1"),
        lambda: __import__("no_such_module"),
    ):
        with pytest.raises((AssertionError, ImportError)), nothing_happens():
            act()
