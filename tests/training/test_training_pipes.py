"""Run directories in which somebody has put a pipe in the place of a file: nothing waits for what it would say."""

import contextlib
import os
import shutil

import pytest

import motorgrad as mg


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trained") / "run"
    mg.train(mg.make("three-state"), steps=20, seeds=1, out=folder)
    return folder


def test_no_pipe_in_a_run_directory_keeps_a_reader_waiting(trained, tmp_path):
    names = sorted(path.relative_to(trained) for path in trained.rglob("*.*") if path.is_file())
    assert {"config.toml", "provenance.json"} < {str(name) for name in names}
    for number, name in enumerate(names):
        copy = tmp_path / str(number)
        shutil.copytree(trained, copy)
        (copy / name).unlink()
        os.mkfifo(copy / name)
        with contextlib.suppress(ValueError, RuntimeError, OSError, Warning):
            mg.load(copy)
