"""Links in folders that somebody else made: they lead nothing that is read or written elsewhere."""

import os
import shutil

import numpy as np
import pytest
from training_examples import assert_same_run

import motorgrad as mg
from motorgrad._files import changing, refuse_links, remove_partials, replacing, write_arrays, write_atomically
from motorgrad.training import RunDirectoryError
from motorgrad.training.store import RunDirectory

RUN = {"task": "three-state", "steps": 3000, "seeds": 2, "window": 1000, "progress": False}
PRECIOUS = b"a file elsewhere"


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    return mg.train(**RUN, out=tmp_path_factory.mktemp("finished") / "run")


@pytest.fixture
def victim(tmp_path):
    """A file elsewhere that must stay as it is."""
    file = tmp_path / "elsewhere" / "victim"
    file.parent.mkdir()
    file.write_bytes(PRECIOUS)
    yield file
    assert file.read_bytes() == PRECIOUS
    assert os.listdir(file.parent) == ["victim"]


@pytest.mark.parametrize("name", [".x.npz.partial", ".x.npz.00000000.partial", "x.npz"])
def test_nothing_is_written_through_a_link_beside_a_file(name, victim, tmp_path):
    (tmp_path / name).symlink_to(victim)
    write_arrays(tmp_path / "x.npz", {"a": np.zeros(3)})
    assert not (tmp_path / "x.npz").is_symlink()


def test_names_of_temporary_files_cannot_be_foreseen(tmp_path):
    names = set()
    for _ in range(20):
        with replacing(tmp_path / "x") as file:
            names.add(file.name)
    assert len(names) == 20
    assert os.listdir(tmp_path) == ["x"]


def test_a_file_is_changed_in_its_place_but_not_through_a_link(victim, tmp_path):
    (tmp_path / "soft").symlink_to(victim)
    with pytest.raises(OSError, match="soft"), changing(tmp_path / "soft"):
        pass
    os.link(victim, tmp_path / "hard")  # as of a backup, which must stay as it is
    with changing(tmp_path / "hard") as file:
        file.write(b"changed")
    assert (tmp_path / "hard").read_bytes() == b"changed" + PRECIOUS[7:]


@pytest.mark.parametrize("make", [os.mkfifo, os.mkdir])
def test_only_a_file_is_replaced(make, tmp_path):
    make(tmp_path / "x")
    with pytest.raises(OSError, match="x"):
        write_atomically(tmp_path / "x", b"")
    with pytest.raises(OSError, match="x"), changing(tmp_path / "x"):
        pass
    assert os.listdir(tmp_path) == ["x"]


def test_orphans_that_are_links_are_removed_and_not_what_they_lead_to(victim, tmp_path):
    (tmp_path / ".x.partial").symlink_to(victim)
    (tmp_path / ".[x].12345678.partial").write_bytes(b"")
    remove_partials(tmp_path, "[x]")
    assert (tmp_path / ".x.partial").is_symlink()
    remove_partials(tmp_path)
    assert os.listdir(tmp_path) == ["elsewhere"]


def uses(path):
    """All that reads or writes a run directory."""
    yield lambda: mg.load(path)
    yield lambda: mg.train(**{**RUN, "steps": 6000}, out=path)
    yield lambda: mg.resume(path, progress=False)
    yield lambda: RunDirectory(path).__enter__()


FILES = [".holder", ".lock", "config.toml", "provenance.json", "metrics/SHA256SUMS", "checkpoint/initial.policies"]


@pytest.mark.parametrize("name", [*FILES, "checkpoint/000000003000.state", "figures/reward.svg", "metrics/.x.partial"])
def test_a_link_in_a_run_directory_is_refused_by_name(name, finished, victim, tmp_path):
    path = shutil.copytree(finished.path, tmp_path / "run")
    (path / name).unlink(missing_ok=True)
    (path / name).symlink_to(victim)
    for use in uses(path):
        with pytest.raises(RunDirectoryError, match=f"{path / name} is a link"):
            use()


@pytest.mark.parametrize("name", ["metrics", "checkpoint", "figures", "tensorboard", "tensorboard/seed-0"])
def test_a_folder_of_a_run_directory_that_is_a_link_is_refused_by_name(name, finished, victim, tmp_path):
    path = shutil.copytree(finished.path, tmp_path / "run")
    shutil.rmtree(path / name, ignore_errors=True)
    (path / name).parent.mkdir(exist_ok=True)
    (path / name).symlink_to(victim.parent)
    for use in uses(path):
        with pytest.raises(RunDirectoryError, match=f"{path / name} is a link"):
            use()


def test_a_run_directory_may_be_a_link_itself(finished, tmp_path):
    path = shutil.copytree(finished.path, tmp_path / "run")
    (tmp_path / "link").symlink_to(path)
    assert_same_run(mg.load(tmp_path / "link"), finished)
    assert_same_run(mg.train(**RUN, out=tmp_path / "link"), finished)
    refuse_links(tmp_path / "link")


@pytest.mark.parametrize("name", ["study.toml", "jobs", "failures", "index.parquet", "index.html", "jobs/1"])
def test_a_link_in_the_folder_of_a_study_is_refused_by_name(name, victim, tmp_path):
    from motorgrad.studies import Study, run_study

    path = tmp_path / "study"
    (path / name).parent.mkdir(parents=True)
    (path / name).symlink_to(victim.parent if "." not in name else victim)
    with pytest.raises(RunDirectoryError, match=f"{path / name} is a link"):
        run_study(Study("three-state", steps=100, seeds=1), path, progress=False)


def test_a_directory_that_could_not_be_entered_is_free_again(tmp_path, monkeypatch):
    with monkeypatch.context() as full:
        full.setattr(os, "fsync", lambda file: os.close(-1))
        with pytest.raises(OSError, match=r"\.holder"):
            RunDirectory(tmp_path / "run").__enter__()
    with RunDirectory(tmp_path / "run"):
        pass
