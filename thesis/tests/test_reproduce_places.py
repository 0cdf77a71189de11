"""Reproducing experiments in other processes: failures are set aside, killed ones go on, the numbers stay the same."""

import json
import multiprocessing
import threading
import time

import numpy as np
import pytest

from motorgrad.cli import main
from motorgrad_thesis import EXPERIMENTS, reproduce_all

pytestmark = [pytest.mark.slow, pytest.mark.ci, pytest.mark.filterwarnings("ignore:os.fork")]
SMALL = EXPERIMENTS["fig-4.9"](longest=6, runs=200)
DRAWN = EXPERIMENTS["fig-2.1"].quick()


@pytest.fixture(scope="module")
def wanted(tmp_path_factory):
    """What one process makes."""
    made = reproduce_all([SMALL, DRAWN], tmp_path_factory.mktemp("wanted"), quick=True, progress=False)
    assert made.complete
    return made


def assert_same(found, wanted):
    """Two reproductions of an experiment have the same numbers, claims and figure, bit for bit."""
    one, other = (np.load(each.folder / "values.npz") for each in (found, wanted))
    assert set(one.files) == set(other.files)
    assert all(np.array_equal(one[name], other[name], equal_nan=True) for name in one.files)
    assert found.claims == wanted.claims
    assert found.figure.read_bytes() == wanted.figure.read_bytes()


def test_a_killed_experiment_goes_on_and_a_failing_one_is_set_aside(wanted, tmp_path):
    values = tmp_path / "fig-2.1" / "values.npz"
    values.parent.mkdir()
    values.write_bytes(b"nothing of use")
    part, killed = tmp_path / "fig-4.9" / "parts" / "walk.npz", []

    def kill():
        while not part.exists():
            time.sleep(0.005)
        for child in multiprocessing.active_children():
            child.kill()
            killed.append(child.pid)

    killer = threading.Thread(target=kill, daemon=True)
    killer.start()
    how = {"quick": True, "on": "processes", "workers": 1, "attempts": 2, "progress": False}
    made = reproduce_all([SMALL, DRAWN], tmp_path, **how)
    killer.join()
    assert killed
    (done,), (failure,) = made.done, made.failures
    assert_same(done, wanted.done[0])
    assert len(done.sessions) == 1  # the killed one left no record of itself, but its part
    assert (failure["job"], failure["attempts"]) == ("fig-2.1", 2)
    assert "values.npz: damaged" in failure["message"]
    assert "fig-2.1: ValueError: " in made.report.read_text()
    assert not made.complete


@pytest.mark.needs("motorgrad[ray]")
def test_reproduce_on_ray(wanted, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out" / "fig-2.2").mkdir(parents=True)
    (tmp_path / "out" / "fig-2.2" / "values.npz").write_bytes(b"nothing of use")
    command = ["reproduce", "fig-2.1", "fig-2.2", "--quick", "--out", "out", "--json", "found.json"]
    assert main([*command, "--on", "ray", "--workers", "2", "--attempts", "1"]) == 1
    assert "set aside after 1 attempts: fig-2.2: ValueError: " in capsys.readouterr().out
    found = json.loads((tmp_path / "found.json").read_text())
    assert [each["name"] for each in found["experiments"]] == ["fig-2.1"]
    assert [each["job"] for each in found["failures"]] == ["fig-2.2"]
    assert (tmp_path / "out" / "fig-2.1" / "figure.svg").read_bytes() == wanted.done[1].figure.read_bytes()


def test_an_experiment_with_other_settings_is_refused_before_any_work(wanted):
    out = wanted.report.parent
    with pytest.raises(ValueError, match=r"holds fig-4.9 with longest = 6, not 7: use another folder"):
        reproduce_all([DRAWN, EXPERIMENTS["fig-4.9"](longest=7, runs=200)], out, progress=False)
    with pytest.raises(ValueError, match=r"unknown on 'rya'"):
        reproduce_all([DRAWN], out, on="rya", progress=False)


def test_places_need_their_own_options(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["reproduce", "fig-2.1", "--address", "auto"]) == 2
    assert "address = 'auto': must be left out, unless --on ray" in capsys.readouterr().err
