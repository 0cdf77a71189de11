"""Studies in processes of this machine: the same numbers as here, whatever is killed."""

import contextlib
import multiprocessing
import os
import signal
import subprocess
import sys
import threading
from pathlib import Path

import pytest
import tomli_w
from study_examples import assert_same_study, checkpoints, small, wait_for

from motorgrad.studies import _driver, run_study

pytestmark = [pytest.mark.slow, pytest.mark.ci]
LONG = {"steps": 400_000, "window": 100_000, "lanes": 4}  # some seconds a job


@pytest.fixture(scope="module")
def study():
    return small(**LONG)


@pytest.fixture(scope="module")
def done(study, tmp_path_factory):
    return study.run(tmp_path_factory.mktemp("done") / "study", progress=False)


def test_killed_workers_cost_nothing_but_time(study, done, tmp_path):
    folder, killed = tmp_path / "study", []

    def kill():
        """Kill each of the workers once it has saved something, and one more before it has."""
        for _ in range(3):
            before = checkpoints(folder)
            wait_for(lambda before=before: len(set(checkpoints(folder)) - set(before)) > 1)
            with contextlib.suppress(IndexError):
                child = multiprocessing.active_children()[0]
                child.kill()
                killed.append(child.pid)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    results = run_study(study, folder, on="processes", workers=2, checkpoint_every=0.2, progress=False)
    assert killed
    assert not results.failures
    assert_same_study(folder, done.path)
    assert not multiprocessing.active_children()


def test_a_job_whose_processes_all_die_is_set_aside(study, tmp_path, monkeypatch):
    monkeypatch.setattr(_driver, "KILLS", 2)
    over = threading.Event()

    def kill():
        while not over.wait(0.01):
            for child in multiprocessing.active_children():
                child.kill()

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    results = run_study(small(lanes=100), tmp_path / "study", on="processes", workers=2, progress=False)
    over.set()
    assert [failure["attempts"] for failure in results.failures] == [2, 2]
    assert "BrokenProcessPool" in results.failures[0]["message"]


@pytest.mark.parametrize("number", [signal.SIGKILL, signal.SIGINT], ids=["SIGKILL", "SIGINT"])
def test_a_driver_that_is_stopped_leaves_what_the_same_command_continues(
    study, done, tmp_path, number, compiled_environment
):
    folder, file = tmp_path / "study", tmp_path / "study.toml"
    file.write_text(tomli_w.dumps(study.as_table()))
    command = [sys.executable, "-m", "motorgrad", "sweep", str(file), "--out", str(folder), "--on", "processes"]
    command += ["--workers", "2", "--checkpoint-every", "0.2"]
    for _ in range(2):
        before = checkpoints(folder)
        driver = subprocess.Popen(command, env=compiled_environment, stderr=subprocess.PIPE, start_new_session=True)
        wait_for(lambda before=before: set(checkpoints(folder)) - set(before))
        if number == signal.SIGINT:
            os.killpg(driver.pid, number)  # as Ctrl-C at a terminal does
            assert driver.wait(600) == 130
            assert b"Traceback" not in driver.communicate()[1]
        else:
            driver.kill()
            driver.communicate(timeout=600)
        # its workers end by themselves
        wait_for(lambda pid=driver.pid: not in_session(pid))
    again = subprocess.run(command, env=compiled_environment, capture_output=True, text=True, timeout=3600)
    assert again.returncode == 0, again.stderr
    assert "saved in" in again.stdout
    assert_same_study(folder, done.path)


def in_session(number):
    """Whether any process of a session is alive: the driver's workers have groups of their own."""
    for process in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(ProcessLookupError):
            if os.getsid(int(process.name)) == number:
                return True
    return False
