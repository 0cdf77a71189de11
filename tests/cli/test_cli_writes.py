"""A disk that is full: every command that writes says so in one line that names the file, ends with a status that is
not 0, and leaves what was there before as it was."""

import errno
import itertools
import os
import shutil
import stat
from pathlib import Path

import numpy as np
import pytest

import motorgrad as mg
import timlab
import timsim
from motorgrad.cli import main

FULL = os.strerror(errno.ENOSPC)
BEFORE = b"a file from before"
OUT = ["--steps", "200", "--seeds", "2", "--window", "50", "--out", "new", "--give-up-after", "0.001"]
STUDY = 'steps = 200\nseeds = 1\ntask.name = "three-state"\nagent.learning_rate = [0.1, 0.2]\n'
COMPARISON = """
steps = 200
metric = "reward"
tasks = ["three-state"]
methods = ["olpomdp"]
seeds = { tune = 1, judge = 1 }
"""
REPRODUCED = ["config.toml", "provenance.json", "values.npz", "figure.svg", "figure.png", "record.json", "report.html"]
COMMANDS = {
    "train": (["train", "three-state", *OUT, "--json", "out.json"], ["new", "out.json"]),
    "evaluate": (["evaluate", "run", "--steps", "50", "--json", "out.json"], ["out.json"]),
    "evaluate --table": (["evaluate", "run", "--steps", "50", "--table", "out.parquet"], ["out.parquet"]),
    "plot": (["plot", "run", "--out", "out.svg"], ["out.svg"]),
    "plot --json": (["plot", "run", "--out", "out.svg", "--json", "out.json"], ["out.svg", "out.json"]),
    "export .c": (["export", "run", "out.c"], ["out.c"]),
    "export .npz": (["export", "run", "out.npz"], ["out.npz"]),
    "bench": (["bench", "--json", "out.json"], ["out.json"]),
    "sweep": (["sweep", "study.toml", "--out", "new", "--workers", "1"], ["study.toml", "index.", ".svg"]),
    "compare": (["compare", "methods.toml", "--out", "new", "--workers", "1"], [".toml", "index.", ".csv", ".svg"]),
    "reproduce": (["reproduce", "fig-2.1", "--quick", "--out", "new"], REPRODUCED),
}
"""The commands that write, and parts of the names of what they write."""
SLOW = ("train", "sweep", "compare", "reproduce")


class Disk:
    """A disk that takes some more files and then is full: what is written is refused when it is to reach the disk."""

    def __init__(self, monkeypatch):
        self.room = None
        self.refused = False
        sync = os.fsync

        def refuse_when_full(file):
            # the runs of a study wait for room, for ten minutes
            waits = "/jobs/" in os.readlink(f"/proc/self/fd/{file}")
            if self.room is not None and not waits and stat.S_ISREG(os.fstat(file).st_mode):
                if self.room == 0:
                    self.refused = True
                    raise OSError(errno.ENOSPC, FULL)
                self.room -= 1
            sync(file)

        monkeypatch.setattr(os, "fsync", refuse_when_full)

    def tries(self):
        """Numbers of files for which there is room, from 0 on, until there is enough for all that is written."""
        for room in itertools.count():
            self.room, self.refused = room, False
            yield room
            self.room = None
            if not self.refused:
                return


@pytest.fixture
def disk(monkeypatch):
    return Disk(monkeypatch)


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    out = tmp_path_factory.mktemp("finished") / "run"
    return mg.train("three-state", steps=200, seeds=2, out=out, window=50, progress=False).path


@pytest.fixture(autouse=True)
def _here(tmp_path, finished, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copytree(finished, "run")
    Path("study.toml").write_text(STUDY)
    Path("methods.toml").write_text(COMPARISON)
    for name in ("out.json", "out.svg", "out.c", "out.npz", "out.parquet", "out.mp4", "out.gif", "out.png", "out.html"):
        Path(name).write_bytes(BEFORE)


def contents():
    """All files of the working folder outside of what a command makes."""
    paths = [path for path in Path().rglob("*") if path.is_file() and path.parts[0] != "new"]
    return {str(path): path.read_bytes() for path in paths if path.name not in (".lock", ".holder")}


@pytest.mark.filterwarnings("ignore::motorgrad.training.RunWarning")
@pytest.mark.parametrize("name", [pytest.param(name, marks=[pytest.mark.ci] * (name in SLOW)) for name in COMMANDS])
def test_a_command_that_cannot_write_says_so_and_loses_nothing(name, disk, capsys, monkeypatch):
    monkeypatch.setattr("motorgrad.commands.bench.speed_table", list)  # it measures for minutes
    command, written = COMMANDS[name]
    status = room = -1
    for room in disk.tries():
        shutil.rmtree("new", ignore_errors=True)
        before = contents()
        status = main(command)
        said = capsys.readouterr().err.splitlines()
        if not disk.refused:
            break
        assert status == 2, said
        assert FULL in said[-1]
        assert any(part in said[-1] for part in written), said
        after = contents()
        changed = [path for path in after if after[path] != before.get(path)]
        assert all(path in written for path in changed)  # what there was room for
        assert len(changed) <= room
        assert before.keys() == after.keys()
        assert not list(Path("new").rglob("*.partial"))
    assert room > 0
    assert status == 0


def _diagram():
    diagram = timlab.Diagram()
    diagram.add("one", timlab.Constant())
    diagram.add("recorder", timlab.Recorder())
    diagram.connect("one.y", "recorder.u")
    return diagram


def _motion():
    model = mg.bodies.read_model(
        "<mujoco><worldbody><body><joint name='x' type='slide'/><geom size='0.1'/></body></worldbody></mujoco>"
    )
    return timsim.Motion(model, np.arange(3) / 10, np.zeros((3, 1)), np.zeros((3, 0)))


LIBRARY = {
    "out.json": lambda: timlab.save(_diagram(), "out.json"),
    "out.npz": lambda: mg.load("run").policy().export("out.npz"),
    "out.svg": lambda: mg.load("run").plot(path="out.svg"),
    "out.gif": lambda: timsim.write_film(_motion(), "out.gif", width=64, height=64, renderer="drawn"),
    "out.png": lambda: timsim.still(_motion(), 0, "out.png", width=64, height=64, renderer="drawn"),
    "out.html": lambda: timsim.write_replay(_motion(), "out.html"),
}
"""What the library writes, beside what the commands do."""


@pytest.mark.parametrize("name", LIBRARY)
def test_what_the_library_cannot_write_it_names_and_leaves_as_it_was(name, disk):
    before = contents()
    for room in disk.tries():
        if room:
            LIBRARY[name]()
            continue
        with pytest.raises(OSError, match=f"{FULL}: '{name}'"):
            LIBRARY[name]()
        assert contents() == before
    assert Path(name).read_bytes() != BEFORE


@pytest.fixture
def full_elsewhere(tmp_path_factory, monkeypatch):
    """The disk is full for the processes that this one starts."""
    folder = tmp_path_factory.mktemp("site")
    (folder / "sitecustomize.py").write_text(REFUSES)
    monkeypatch.setenv("PYTHONPATH", str(folder))


REFUSES = f"""
import os, stat
sync = os.fsync
def refuse(file):
    if stat.S_ISREG(os.fstat(file).st_mode):
        raise OSError({errno.ENOSPC}, {FULL!r})
    sync(file)
os.fsync = refuse
"""
WATCH = ["sim", "hopper", "--no-browser", "--seconds", "0.5"]


@pytest.mark.ci
@pytest.mark.needs("motorgrad[sim]")
def test_a_policy_that_a_live_run_cannot_save_is_told_and_the_one_before_is_kept(request, capsys):
    command = [*WATCH, "--autosave", "first.npz", "--autosave-every", "0.1"]
    assert main(command) == 0
    before = contents()
    request.getfixturevalue("full_elsewhere")
    status = main(command)
    said = capsys.readouterr().err.splitlines()
    assert status == 2, said
    assert said[-1] == f"motorgrad sim: policy not saved to first.npz: [Errno {errno.ENOSPC}] {FULL}: 'first.npz'"
    assert contents() == before
