"""Every test of studies works in a folder of its own: MuJoCo notes divergences in the working directory."""

import pytest


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
