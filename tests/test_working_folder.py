"""A stranger's files in the working folder take the place of no module, in no process that is started here."""

import multiprocessing
import os
import pickle
import re
import subprocess
import sys
from pathlib import Path

import pytest

import motorgrad
from motorgrad._processes import SAFE, environment
from motorgrad.cli import main
from motorgrad.studies import Study, run_study
from motorgrad.studies._executors import process_settings
from motorgrad.studies._jobs import Outcome, Work, parcel, work_parcel
from motorgrad.tasks.gymnasium import _workers
from timsim.film import _gl
from timsim.live import _session

SHADOWS = ("struct", "subprocess", "random", "numpy", "jax", "mujoco", "gymnasium", "cloudpickle", "motorgrad")
SHADOW = "import sys\nopen({mark!r}, 'a').write(f'{{__name__}} in {{sys.argv}}')\nraise ImportError(__name__)\n"
COMMAND = Path(sys.executable).with_name("motorgrad")


@pytest.fixture
def mark(tmp_path, monkeypatch):
    """The file that a stranger's modules write where they run; they lie in the working folder."""
    folder, mark = tmp_path / "strange", tmp_path / "ran"
    folder.mkdir()
    for name in SHADOWS:
        (folder / f"{name}.py").write_text(SHADOW.format(mark=str(mark)))
    monkeypatch.chdir(folder)
    monkeypatch.delenv("PYTHONSAFEPATH", raising=False)
    return mark


def test_a_stranger_would_be_heard(mark):
    subprocess.run([sys.executable, "-c", "import struct"], stderr=subprocess.DEVNULL)
    assert "struct in ['-c']" in mark.read_text()


def test_a_new_process_finds_its_own_modules(mark):
    process = multiprocessing.get_context("spawn").Process(target=os.getcwd)
    with _session._bare_main(), environment():
        process.start()
    process.join(600)
    assert process.exitcode == 0
    assert not mark.exists()
    assert "PYTHONSAFEPATH" not in os.environ


def test_a_worker_finds_its_own_modules(mark):
    worker = _workers._Worker()
    worker.process.communicate(b"")  # its input ends, which it is not told before it has loaded everything
    assert not mark.exists()


@pytest.mark.needs("OpenGL")
def test_the_trial_picture_finds_its_own_modules(mark):
    _gl._problem.cache_clear()
    assert _gl.gl_problem() == ""
    assert not mark.exists()


@pytest.mark.skipif(not COMMAND.exists(), reason="the command is not installed")
@pytest.mark.ci
@pytest.mark.parametrize(
    "words",
    [
        "list",  # loads MuJoCo, and so glfw, which starts a process
        "train gymnasium --task.env-id CartPole-v1 --steps 20 --seeds 2 --workers 2 --out ../run",
        "sweep ../study.toml --on processes --workers 1 --out ../study",
        "sim chain --seconds 0.1 --no-browser",
        "--import my_tasks list",
        pytest.param(
            "--import my_tasks sweep ../study.toml --on ray --workers 1 --out ../study",
            marks=[pytest.mark.needs("motorgrad[ray]"), pytest.mark.slow],
        ),
    ],
)
def test_a_command_and_its_processes_find_their_own_modules(words, mark, process_environment):
    mark.with_name("study.toml").write_text('steps = 20\nseeds = 1\ntask.name = "chain"\nagent.baseline = ["none"]\n')
    Path("my_tasks.py").write_text("import jax, mujoco, motorgrad.tasks\n")
    bare = {name: value for name, value in process_environment.items() if name not in SAFE}
    done = subprocess.run([COMMAND, *words.split()], env=bare, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert not mark.exists(), mark.read_text()


@pytest.mark.needs("motorgrad[slurm]")
@pytest.mark.slow
@pytest.mark.ci
def test_a_job_of_submitit_finds_its_own_modules(mark):
    study = Study("chain", steps=20, seeds=1)
    results = run_study(
        study, mark.with_name("study"), on="slurm", workers=1, progress=False, options={"cluster": "local"}
    )
    assert not results.failures
    assert not mark.exists()


def test_a_module_that_is_named_is_found_last(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [place for place in sys.path if place])
    before = [*sys.path]
    assert main(["--import", "json", "--version"]) == 0
    assert sys.path == before  # or what other libraries try to import would be looked for here
    (tmp_path / "named_here.py").write_text("import there_too\n")
    (tmp_path / "there_too.py").write_text("")
    assert main(["--import", "named_here", "--version"]) == 0
    assert sys.path == [*before, ""]
    (tmp_path / "folder").mkdir()
    for name in ("by_its_path", "colorsys"):  # which is a module of Python's
        (tmp_path / "folder" / f"{name}.py").write_text("")
    assert main(["--import", "folder/by_its_path.py", "--version"]) == 0
    assert sys.path == [*before, "", str(tmp_path / "folder")]
    sys.modules.pop("colorsys", None)
    assert main(["--import", "folder/colorsys.py", "--version"]) == 2
    assert "cannot import 'colorsys': another module of this name is installed" in capsys.readouterr().err
    assert main(["--import", ".x", "--version"]) == 2
    assert "cannot import '.x': must be the name of a module" in capsys.readouterr().err
    for name in ("named_here", "there_too", "by_its_path"):
        del sys.modules[name]


JOB = """
from motorgrad.studies._jobs import Outcome

class Job:
    name = "job"
    def do(self, path, job_settings):
        return Outcome(str(path))
"""


def test_a_job_elsewhere_finds_modules_that_are_named_and_finds_them_last(mark, tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "path", [*sys.path, str(Path.cwd())])
    Path("my_job.py").write_text(JOB)
    import my_job  # pyright: ignore[reportMissingImports]

    sent = pickle.loads(pickle.dumps(parcel(my_job.Job(), tmp_path / "job", Work(imports=("my_job",)))))
    folder = Path.cwd()
    monkeypatch.setattr(sys, "path", sys.path[:-1])
    del sys.modules["my_job"]
    monkeypatch.chdir(tmp_path)
    assert work_parcel(*sent) == Outcome(str(tmp_path / "job"))
    assert (Path.cwd(), sys.path[-1]) == (folder, str(folder))
    assert not mark.exists()
    del sys.modules["my_job"]
    assert process_settings(2)["PYTHONSAFEPATH"] == "1"  # where Ray and Slurm start it
    assert parcel(my_job.Job(), tmp_path, Work())[2] == ()


STARTS = re.compile(r"sys\.executable|get_context\(|ProcessPoolExecutor\(")


def test_every_process_of_python_is_started_so():
    root = Path(motorgrad.__file__).parent
    started = [file for file in root.rglob("*.py") if STARTS.search(file.read_text())]
    assert root / "tasks" / "gymnasium" / "_workers.py" in started
    for file in started:
        assert re.search(r"\bSAFE\b|\benvironment\(", file.read_text()), file
