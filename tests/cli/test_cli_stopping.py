"""Being stopped, and being read by half: what a shell may do to a command."""

import contextlib
import gc
import signal
import subprocess
import sys
import threading
import time

import pytest

import motorgrad as mg
from motorgrad import _signals
from motorgrad.cli import main
from motorgrad.training import RunDirectoryError


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)


def start(environment, *arguments):
    command = [sys.executable, "-m", "motorgrad", *arguments]
    return subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True, env=environment)


@pytest.mark.ci
@pytest.mark.representatives("0.7-2")
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
@pytest.mark.parametrize("after", [0.7, 1.5])
def test_a_signal_during_the_start_up_stops_the_command(number, after, process_environment):
    child = start(process_environment, "train", "hopper", "--steps", "1000000")
    time.sleep(after)
    child.send_signal(number)
    _, said = child.communicate(timeout=1200)
    # on a slow machine the interpreter itself may not be ready yet, and the signal does what it always does
    assert child.returncode in (130, -number), said
    assert child.returncode < 0 or "stopped" in said


def test_an_interrupt_that_a_library_swallowed_is_remembered():
    with _signals.interrupt_when_asked():
        with contextlib.suppress(KeyboardInterrupt):  # as a callback of another library may
            signal.raise_signal(signal.SIGTERM)
        with pytest.raises(KeyboardInterrupt), _signals.stop_when_asked():
            pass
    with _signals.interrupt_when_asked(), _signals.stop_when_asked() as stopped:
        assert not stopped()


def test_the_end_of_the_terminal_stops_what_does_not_ignore_it(monkeypatch):
    monkeypatch.setattr(_signals, "_asked", threading.Event())  # later tests train in this process
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    try:
        with pytest.raises(KeyboardInterrupt), _signals.interrupt_when_asked():
            signal.raise_signal(signal.SIGHUP)
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as `nohup` does
        with _signals.interrupt_when_asked():
            signal.raise_signal(signal.SIGHUP)
        assert not _signals.asked()
    finally:
        signal.signal(signal.SIGHUP, before)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_an_interrupt_while_garbage_is_collected_is_not_lost(number, capfd, monkeypatch):
    monkeypatch.setattr(_signals, "_asked", threading.Event())  # later tests train in this process

    def interrupt(phase, info):
        gc.callbacks.remove(interrupt)
        signal.raise_signal(number)

    def collect():
        gc.callbacks.append(interrupt)
        gc.collect(0)
        time.sleep(600)

    with pytest.raises(KeyboardInterrupt), _signals.interrupt_when_asked():
        collect()
    assert not capfd.readouterr().err


@pytest.mark.ci
@pytest.mark.representatives("arguments3")
@pytest.mark.parametrize(
    "arguments", [["train", "hopper", "--help"], ["train", "chain", "--check"], ["list"], ["--help"]]
)
def test_a_reader_that_has_enough_is_no_error(arguments, process_environment):
    child = start(process_environment, *arguments)
    child.stdout.close()  # as head does once it has its lines
    said = child.stderr.read()
    assert child.wait(1200) == 0
    assert said == ""
    child.stderr.close()


def test_an_unfinished_run_keeps_its_goal(tmp_path, monkeypatch):
    def stopped(self, decisions):
        advance(self, decisions)
        if self.decision >= 40:
            signal.raise_signal(signal.SIGINT)

    advance = mg.training.WorldStepper.advance
    monkeypatch.setattr(mg.training.WorldStepper, "advance", stopped)
    with pytest.raises(
        KeyboardInterrupt, match=r"stopped after \d+ of 400 decisions, saved in run; the same call"
    ) as stop:
        mg.train("chain", steps=400, window=20, out="run", progress=False)
    run = stop.value.run
    assert not run.complete
    monkeypatch.undo()
    monkeypatch.chdir(tmp_path)
    with pytest.raises(
        RunDirectoryError, match=rf"run of 400 decisions, of which {run.decision} are made, but steps = 60"
    ):
        mg.train("chain", steps=60, window=20, out="run", progress=False)
    assert mg.resume("run", progress=False).decision == 400
    assert mg.train("chain", steps=60, window=20, out="run", progress=False).decision == 400  # finished: given back


@pytest.mark.slow
def test_films_of_other_evaluations_do_not_take_each_others_place(capsys):
    mg.train("hopper", steps=40, seeds=2, out="run", progress=False)
    for options in ([], ["--untrained"], ["--mode", "mode", "--seed", "1"]):
        assert main(["evaluate", "run", "--steps", "20", *options]) == 0
    films = {path.name for path in (mg.load("run").path / "figures").glob("*.mp4")}
    assert films == {"evaluation.mp4", "evaluation-untrained.mp4", "evaluation-mode-seed-1.mp4"}
    assert "0.2 s of 10, for more take more --steps" in capsys.readouterr().out


def test_a_film_of_what_has_no_body_is_refused(capsys):
    mg.train("chain", steps=40, out="run", progress=False)
    assert main(["evaluate", "run", "--video", "film.mp4"]) == 2
    assert "task 'chain' has no body" in capsys.readouterr().err


def test_an_evaluation_says_itself_in_a_line():
    run = mg.train("chain", steps=40, seeds=2, progress=False)
    assert repr(mg.evaluate(run, 30)).startswith("Evaluation(2 seeds, 30 decisions, median reward ")


SCRIPT = """
import os, signal, sys, motorgrad as mg

def interrupt(report):
    if report.decision == 200:
        os.kill(os.getpid(), {number})

{call}
print("went on")
"""
TRAINS = 'mg.train("three-state", steps=100_000, window=100, out={out}, callbacks=interrupt, progress=False)'
CATCHES = f"try:\n    {TRAINS}\nexcept KeyboardInterrupt as stop:\n    print(stop, stop.run)"


def script(environment, folder, number, call, out):
    code = SCRIPT.format(number=int(number), call=call.format(out=out))
    return subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, cwd=folder)


@pytest.mark.parametrize("number", [signal.SIGINT, pytest.param(signal.SIGTERM, marks=pytest.mark.ci)])
def test_a_script_that_is_stopped_ends_as_interrupted_and_says_how_far_it_is(number, compiled_environment, tmp_path):
    done = script(compiled_environment, tmp_path, number, TRAINS, "'run'")
    assert done.returncode == -signal.SIGINT  # what a shell needs to end a loop of scripts
    assert "went on" not in done.stdout
    decision = mg.load(tmp_path / "run").decision
    last = done.stderr.splitlines()[-1]
    assert last == (
        f"KeyboardInterrupt: stopped after {decision:,} of 100,000 decisions, saved in run; the same call continues"
    )


@pytest.mark.ci
def test_a_script_may_catch_the_stop_and_have_the_unfinished_run(compiled_environment, tmp_path):
    done = script(compiled_environment, tmp_path, signal.SIGINT, CATCHES, "None")
    assert done.returncode == 0, done.stderr
    first, last = done.stdout.splitlines()
    assert "it is not saved, as there is no `out`: `run` of this exception has all Run(three-state, 1 seed, " in first
    assert last == "went on"


def test_a_study_that_is_stopped_interrupts_once_all_is_saved(tmp_path, monkeypatch):
    def stopped(self, decisions):
        advance(self, decisions)
        signal.raise_signal(signal.SIGINT)

    advance, study = mg.training.WorldStepper.advance, mg.Study("chain", {"learning_rate": [0.1]}, steps=400)
    with monkeypatch.context() as patch:
        patch.setattr(mg.training.WorldStepper, "advance", stopped)
        with pytest.raises(KeyboardInterrupt, match="and the same call continues") as stop:
            study.run(tmp_path / "study", progress=False)
    assert not stop.value.results.complete
    assert study.run(tmp_path / "study", progress=False).complete
