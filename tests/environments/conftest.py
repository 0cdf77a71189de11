"""Shared by the tests of environments."""

import os

# A test that asks for no window must not find one; the one that does starts a process of its own.
os.environ.setdefault("MPLBACKEND", "agg")

import pytest


@pytest.fixture(autouse=True)
def _log_elsewhere(tmp_path, monkeypatch):
    # MuJoCo notes a divergence in MUJOCO_LOG.TXT in the working directory
    monkeypatch.chdir(tmp_path)
