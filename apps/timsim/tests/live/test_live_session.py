"""Whole sessions: a process, a page, clients that come and go."""

import math
import os
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import motorgrad as mg
import timsim
from motorgrad.training import agent_for, stepper_for
from patience import PATIENCE, until
from timsim import live
from timsim._watching_client import watch


def resident(pid):
    """Resident memory of a process in bytes."""
    with open(f"/proc/{pid}/statm") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")


@pytest.fixture
def page(messages_to_who_has_left):
    """A hopper's page, at first paused."""
    with timsim.view("hopper", seed=3, playing=False) as page:
        yield page


@pytest.mark.ci
def test_a_page_is_played_stepped_and_left(page):
    session = page.session
    assert session.snapshot().decision == 0
    session.order(live.Step(3))
    assert until(lambda: session.snapshot().decision == 3)
    session.order(live.Speed(math.inf))
    session.order(live.Play())
    assert until(lambda: session.snapshot().decision > 500)
    snapshot, trail, curve = session.snapshot(), session.trail(), session.curve()
    assert snapshot.playing
    assert snapshot.position.shape == (1, session.model.nq)
    assert np.all(np.diff(trail.decision) >= 1)
    assert trail.activation.shape == (len(trail.decision), len(session.muscles))
    assert set(curve.values) == {"reward", "apex"}
    session.order(live.Pause())
    assert until(lambda: not session.snapshot().playing)
    session.order(live.Edit("body.flexor_left.strength", 250.0))
    session.order(live.Edit("agent.estimator.trace.decay", 3.0))
    assert until(lambda: session.settings["body.flexor_left.strength"] == 250.0)
    assert session.model.actuator_gainprm[0, 0] == -250.0
    assert until(lambda: len(session.log) == 2)
    assert [event.kind for event in session.log] == ["change", "error"]
    for wrong, says in (
        (live.Edit("agent.optimizer.learning_ratte", 1.0), "did you mean 'agent.optimizer.learning_rate'"),
        (live.Push("loaf", (1.0, 0.0, 0.0)), "did you mean 'load'"),
        (live.Control(0, 1.0), "actuator = 0"),
        (live.Scrub(10**9), "decision = 1000000000: must be from 0 to"),
    ):
        with pytest.raises(ValueError, match=r".") as refused:
            session.order(wrong)
        assert says in str(refused.value)
    with pytest.raises(ValueError, match=f"port = {page.server.get_port()}: cannot listen on"):
        timsim.view("hopper", port=page.server.get_port())
    assert page.url in page._repr_html_()
    page.close()
    page.close()
    with pytest.raises(RuntimeError, match="closed"):
        session.snapshot()


@pytest.mark.ci
def test_a_worker_that_is_killed_is_told_and_waits_for_nobody(page):
    session = page.session
    os.kill(session._process.pid, signal.SIGKILL)
    assert until(lambda: session.ended)
    with pytest.raises(RuntimeError, match="hopper: the simulation has ended"):
        session.order(live.Play())


@pytest.mark.ci
def test_a_task_of_the_users_own_script_needs_no_guard(tmp_path, compiled_environment):
    script = tmp_path / "mine.py"
    script.write_text(
        "import motorgrad as mg, time, timsim\n"
        "class Mine(type(mg.make('chain'))):\n"
        "    name = 'mine'\n"
        "agent = mg.Agent(lambda key: mg.policies.softmax(task), mg.learning.olgarb(0.5))\n"
        "task = Mine()\n"
        "page = timsim.view(task, agent, speed=float('inf'))\n"
        "while page.session.snapshot().decision < 100: time.sleep(0.02)\n"
        "page.close()\n"
        "print('done')\n"
    )
    done = subprocess.run([sys.executable, str(script)], capture_output=True, text=True, env=compiled_environment)
    assert done.stdout.split() == ["done"], done.stderr
    assert done.stderr == ""


def soak(seconds, speed, clients, least):
    """Learn for so long and so many decisions while clients come, reload and leave; what grew, and what was learned."""
    failed, visits = [], []

    def visit(number):
        rng = np.random.default_rng(number)
        while time.monotonic() < end - 1:
            pause = 0.3 if number == 0 else 0.0  # one is slow
            stay = rng.uniform(0.5, 2.0)
            try:
                messages, _ = watch(page.url, stay, pause)
                while not messages and stay < PATIENCE:  # on a busy machine this may be too short to be served
                    stay *= 4
                    messages, _ = watch(page.url, stay, pause)
                visits.append(messages)
            except Exception as error:
                failed.append(error)

    with timsim.view("hopper", seed=3, speed=speed) as page:
        assert until(lambda: page.session.snapshot().decision > 200)
        end = time.monotonic() + seconds
        threads = [threading.Thread(target=visit, args=(number,)) for number in range(clients)]
        for thread in threads:
            thread.start()
        time.sleep(min(60.0, seconds / 2))  # until everything was compiled and every buffer made
        before = resident(page.session._process.pid), resident(os.getpid())
        for thread in threads:
            thread.join()
        after = resident(page.session._process.pid), resident(os.getpid())
        grown = [now - then for now, then in zip(after, before, strict=True)]
        assert until(lambda: page.session.snapshot().decision > least)
        page.session.order(live.Pause())
        assert until(lambda: not page.session.snapshot().playing)
        events, end = list(page.session.log), page.session.snapshot()
        assert page.failures == 0
    assert failed == []
    assert visits
    assert all(visits)
    assert [event for event in events if event.kind in ("error", "ended")] == []
    task = mg.make("hopper")
    alone = stepper_for(task, agent_for(task), [3])
    alone.advance(end.decision)
    assert np.array_equal(alone.harvest()["parameters"][0], end.parameters[0])
    assert np.array_equal(alone.batch.packed[0, :6], end.position[0].astype(np.float32))
    # the page's process holds what its visitors' connections took, some 0.2 MB each
    return end, grown[0], grown[1] - len(visits) * 0.4 * 2**20


@pytest.mark.ci
def test_clients_that_come_and_go_change_nothing(capfd, messages_to_who_has_left):
    end, *grown = soak(6.0, 5.0, 3, least=500)
    assert "Traceback" not in capfd.readouterr().err
    assert end.decision > 500
    assert max(grown) < 64 * 2**20


@pytest.mark.slow
def test_ten_minutes_of_clients_that_come_and_go(capfd, messages_to_who_has_left):
    """The worker may keep 256 MB of states to go back to, of which a hopper needs a few."""
    end, *grown = soak(600.0, 10.0, 4, least=50_000)
    assert "Traceback" not in capfd.readouterr().err
    assert end.decision > 50_000
    assert max(grown) < 64 * 2**20
