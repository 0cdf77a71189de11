"""The code on the page about bodies runs and gives what the page says."""

import pathlib
import re

import numpy as np

PAGE = pathlib.Path(__file__).parents[2] / "docs" / "bodies.md"


def test_code_blocks_run(capsys):
    names: dict = {}
    for block in re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL):
        exec(block, names)
    np.testing.assert_allclose(names["state"].sensors["foot_height"], 0.50, atol=0.005)
    assert names["strapped"].groups == ("flexor", "extensor", "strap")
    assert names["model"].opt.gravity[2] == -1.62
    assert names["xml"].startswith("<mujoco")
    assert "strap" in capsys.readouterr().out
