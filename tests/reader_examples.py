"""The readers of strangers' files, each with a good file of its kind."""

import dataclasses
import functools
import json
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
from PIL import Image

import motorgrad as mg
import timlab
from motorgrad._files import read_arrays
from motorgrad.bodies import Arm, Terrain, read_model
from motorgrad.bodies.arm._lift import LiftTable
from motorgrad.cli import main
from motorgrad.export._reader import read as read_exported
from motorgrad.studies import Comparison, Results, Study
from motorgrad.studies._folder import StudyFolder
from motorgrad.studies._jobs import _failure
from motorgrad.tasks.gymnasium._state import read_state, write_state
from motorgrad.tasks.terms import Follow
from motorgrad.training import NotTrusted, RunDirectoryError
from motorgrad.training.store._checkpoint import CorruptCheckpoint, checksum
from timlab.blocks._tables import read_columns
from timlab.editor._unsaved import JOURNAL_FORMAT, read_unsaved
from timsim.film._motion_file import read_activations, read_motion
from timsim.live._policy import load_policy, save_policy
from timsim.planet import Planet

REFUSALS = (ValueError, NotTrusted, RunDirectoryError, CorruptCheckpoint, OSError)
UNITS = Path(__file__).parents[1] / "apps" / "timlab" / "tests" / "fmi"


@dataclasses.dataclass
class Reader:
    """A kind of file: `make` writes a good one into a folder and returns it, `read` reads it.

    - `finish`: what is done to a file that was changed, before it is read.
    - `nameless`: whether it is given as content, so that whoever reads it adds its name.
    - `needs`: what must be installed.
    """

    make: Callable[[Path], Path]
    read: Callable[[Path], Any]
    finish: Callable[[Path], Any] = lambda file: None
    nameless: bool = False
    needs: str = ""


def picture(folder: Path) -> Path:
    Image.fromarray(np.arange(16, dtype=np.uint8).reshape(4, 4)).save(folder / "map.png")
    return folder / "map.png"


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
    functions = json.loads(str(read_arrays(file)["functions"]))
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
    timlab.save(timlab.example("ball"), folder / "ball.lab.json")
    return folder / "ball.lab.json"


def array(name: str, numbers: Any) -> Callable[[Path], Path]:
    def make(folder: Path) -> Path:
        np.save(folder / name, numbers)
        return folder / name

    return make


def parquet(folder: Path) -> Path:
    table = pa.table({"time": np.arange(3.0), "a": np.arange(3.0), "t": ["x", "y", "z"]})
    pq.write_table(table, folder / "t.parquet")
    return folder / "t.parquet"


def columns(file: Path) -> Any:
    return read_columns(str(file), ("time", "a"))


def model_beside(file: Path) -> Any:
    return read_model(file.with_name("m.xml"))


def motion(file: Path) -> Any:
    return read_motion(file, model_beside(file))


def activations(file: Path) -> Any:
    return read_activations(file, model_beside(file))


def including(folder: Path) -> Path:
    written("whole.xml", '<mujoco><include file="part.xml"/></mujoco>')(folder)
    return written("part.xml", MODEL)(folder)


def unit(version: int) -> Callable[[Path], Path]:
    """The description of a unit, which `packed` makes a unit."""
    text = (UNITS / f"ball{version}.xml").read_text().replace("SAVES", "")

    def make(folder: Path) -> Path:
        file = written("ball.xml", text)(folder)
        pack(file)
        return file

    return make


def pack(file: Path) -> None:
    with zipfile.ZipFile(file.with_suffix(".fmu"), "w") as archive:
        archive.write(file, "modelDescription.xml")


def read_unit(file: Path) -> Any:
    block = timlab.Fmu(str(file.with_suffix(".fmu")))
    return block.inputs, block.outputs, block.unit_variables, block.no_restore


def lift_table(folder: Path) -> Path:
    LiftTable(Arm(), np.ones(3), np.ones((3, 4))).save(folder / "lift.npz")
    return folder / "lift.npz"


def study_in(folder: Path) -> StudyFolder:
    """The folder of a study of which nothing has run, with an index, and one job that was set aside."""
    study = Study("three-state", {"learning_rate": [0.1, 0.2]}, steps=100, seeds=1)
    with StudyFolder(folder / "study", study) as made:
        made.write_index()
        made.set_aside(study.jobs[0], 1, ValueError("no"), "traceback")
    return made


folder_at = functools.cache(StudyFolder)  # it checks the settings of all jobs


def read_index(file: Path) -> Any:
    """The rows in an index. One that is damaged has none, and is made again."""
    found = folder_at(file.parent)._stored()
    if not found:
        raise ValueError(f"{file}: damaged")
    return found


def journal(folder: Path) -> Path:
    text = timlab.dumps(timlab.example("ball"))
    edit = {"op": "set", "at": [], "name": None, "field": "title", "value": "x"}
    lines = [{"format": JOURNAL_FORMAT, "file": None, "diagram": text}, {"do": edit}, {"diagram": text}]
    return written("ball.journal", "".join(f"{json.dumps(line)}\n" for line in lines))(folder)


def read_journal(file: Path) -> Any:
    unsaved = read_unsaved(file)
    return unsaved and (unsaved.title, unsaved.diagram())


TASK = 'env_id = "CartPole-v1"\nrepeat = 2\n'
AGENT = 'learning_rate = 0.01\n[agent.estimator]\nkind = "olgarb"\n'
MODEL = """<mujoco><worldbody><site name="o" pos="0 0 1"/><body name="a">
<joint name="j" type="hinge" axis="0 1 0" range="-90 90"/><geom size="0.1"/><site name="s" pos="0.2 0 0"/></body>
</worldbody><tendon><spatial name="t"><site site="s"/><site site="o"/></spatial></tendon>
<actuator><motor name="m" tendon="t"/></actuator></mujoco>"""
ROBOT = """<robot name="r"><link name="a"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><link name="b"><inertial><mass value="1"/>
<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link><joint name="j" type="revolute">
<parent link="a"/><child link="b"/><axis xyz="0 1 0"/><limit lower="-1" upper="1"/></joint></robot>"""
STORED = "walk\nversion=1\ninDegrees=yes\nendheader\ntime\tj\n0\t0\n0.1\t20\n0.2\t10\n"
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
    "state of a run": Reader(state_of_run, lambda file: mg.load(file.parents[1]).policies, with_right_checksum),
    "policy": Reader(policy_file, lambda file: load_policy(file, mg.policies.hyperplanes(2, 3), "particle")),
    "state of an environment": Reader(
        state_of_environment, lambda file: read_state(file.read_bytes(), made_environment()), nameless=True
    ),
    "exported policy": Reader(exported, call_exported),
    "diagram": Reader(diagram, lambda file: timlab.load(file)),
    "model": Reader(written("m.xml", MODEL), lambda file: mg.bodies.Mjcf(str(file)).model),
    "robot": Reader(written("r.urdf", ROBOT), read_model),
    "included model": Reader(including, lambda file: read_model(file.with_name("whole.xml"))),
    "table as text": Reader(written("t.csv", "time,a\n0,1\n1,2.5\n"), columns),
    "table as arrays": Reader(archive(time=np.arange(3.0), a=np.arange(3.0)), columns),
    "table as Parquet": Reader(parquet, columns),
    "motion as text": Reader(written("w.csv", "time,j\n0,0\n0.1,0.2\n0.2,0.1\n"), motion),
    "motion of joints": Reader(archive(time=np.arange(3.0), j=np.zeros(3)), motion),
    "motion of coordinates": Reader(archive(qpos=np.zeros((3, 1)), activation=np.zeros((3, 1))), motion),
    "motion as an array": Reader(array("w.npy", np.zeros((3, 1))), motion),
    "motion of OpenSim": Reader(written("w.mot", STORED), motion),
    "states of OpenSim": Reader(written("w.sto", STORED.replace("\tj\n", "\t/jointset/x/j/value\n")), motion),
    "activations": Reader(written("w.csv", "time,m\n0,0\n0.1,0.2\n0.2,0.1\n"), activations),
    "trajectory as text": Reader(
        written("p.csv", "time,x\n0,0\n1,2\n"), lambda file: Follow(joints="j", file=str(file))
    ),
    "trajectory as arrays": Reader(
        archive(time=np.arange(3.0), values=np.zeros(3)), lambda file: Follow(joints="j", file=str(file))
    ),
    "map of a planet": Reader(array("map.npy", np.zeros((8, 16))), lambda file: Planet(map=file).surface),
    "ground as a picture": Reader(picture, lambda file: Terrain(map=file).heights().shape),
    "ground as an array": Reader(array("map.npy", np.eye(8)), lambda file: Terrain(map=file).heights().shape),
    "ground as a table": Reader(written("m.csv", "1,2\n3,4.5\n"), lambda file: Terrain(map=file).heights().shape),
    "ground as a grid": Reader(
        written("m.asc", "ncols 2\nnrows 2\nNODATA_value -9\n1 2 3 4.5\n"),
        lambda file: Terrain(map=file).heights().shape,
    ),
    "table of lifts": Reader(lift_table, LiftTable.load),
    "index of a study": Reader(lambda folder: study_in(folder).path / "index.parquet", read_index),
    "study in its folder": Reader(
        lambda folder: study_in(folder).path / "study.toml", lambda file: Results.load(file.parent).failures
    ),
    "failure of a job": Reader(
        lambda folder: next((study_in(folder).path / "failures").glob("*.json")),
        _failure,
    ),
    "journal": Reader(journal, read_journal, nameless=True),
    "unit of version 2": Reader(unit(2), read_unit, pack, needs="motorgrad[fmi]"),
    "unit of version 3": Reader(unit(3), read_unit, pack, needs="motorgrad[fmi]"),
}
