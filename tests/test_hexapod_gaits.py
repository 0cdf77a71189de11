"""The search for rhythms of the hexapod's muscles."""

from pathlib import Path

import numpy as np
import pytest


@pytest.mark.slow
def test_rhythms_drive_the_muscles_of_both_sides_and_a_search_continues(tmp_path, capsys, monkeypatch):
    monkeypatch.syspath_prepend(str(Path(__file__).parents[1]))
    from tools import hexapod_gaits as tool

    start = {name: bounds.start for name, bounds in tool.space(4.0).ranges.items()}
    silent = {name: 0.0 if name.startswith("duty") else number for name, number in start.items()}
    straight, speed, fallen = tool.walk([start, silent], 60)
    assert straight.shape == speed.shape == (60, 2)
    assert not fallen.any()
    assert np.abs(speed[30:, 0]).mean() > 3 * np.abs(speed[30:, 1]).mean()  # without muscles it lies still
    monkeypatch.setattr(tool, "LENGTH", 40)
    monkeypatch.setattr(tool, "LONG", 40)
    for rounds in (1, 2):
        tool.main([str(tmp_path), "--seeds", "1", "--rounds", str(rounds)])
        assert "m/s along the heading" in capsys.readouterr().out
