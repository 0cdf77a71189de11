"""Shared by the tests of the bodies: what MuJoCo keeps for the whole process is put back after each."""

import mujoco
import pytest


@pytest.fixture(autouse=True)
def _callback_restored():
    kinds = ("gain", "dyn", "bias")
    before = [getattr(mujoco, f"get_mjcb_act_{kind}")() for kind in kinds]
    yield
    for kind, callback in zip(kinds, before, strict=True):
        getattr(mujoco, f"set_mjcb_act_{kind}")(callback)


@pytest.fixture(autouse=True)
def _log_elsewhere(tmp_path, monkeypatch):
    # MuJoCo notes a divergence in MUJOCO_LOG.TXT in the working directory
    monkeypatch.chdir(tmp_path)
