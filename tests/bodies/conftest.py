"""Shared by the tests of the bodies: what MuJoCo keeps for the whole process is put back after each."""

import mujoco
import pytest


@pytest.fixture(autouse=True)
def _callback_restored():
    before = mujoco.get_mjcb_act_gain()
    yield
    mujoco.set_mjcb_act_gain(before)


@pytest.fixture(autouse=True)
def _log_elsewhere(tmp_path, monkeypatch):
    # MuJoCo notes a divergence in MUJOCO_LOG.TXT in the working directory
    monkeypatch.chdir(tmp_path)
