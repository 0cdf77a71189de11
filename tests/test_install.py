"""Installing the tested versions: files are what `hashes.txt` says, or nothing is installed."""

import re
from pathlib import Path

from tools.hashes import pins
from tools.install import ROOT, all_known, hashes, normal, requirements


def test_every_tested_version_has_hashes():
    listed = re.findall(r"^([^#\s]+==\S+) ", (ROOT / "hashes.txt").read_text(), re.MULTILINE)
    assert listed == pins()
    assert all(hashes()[normal(pin.split("==")[0])] for pin in listed)


def test_an_exchanged_file_is_refused_by_name(tmp_path: Path, capsys):
    exchanged, other = tmp_path / "numpy-2.3.5-py3-none-any.whl", tmp_path / "not_listed-1.0-py3-none-any.whl"
    for file in (exchanged, other):
        file.write_bytes(b"something else")
    assert all_known([other])
    assert "not_listed-1.0-py3-none-any.whl: hashes.txt has no such package" in capsys.readouterr().err
    assert not all_known([other, exchanged])
    told = capsys.readouterr().err
    assert "numpy-2.3.5-py3-none-any.whl: SHA-256 " in told
    assert "CHECK=no" in told


def test_extras_ask_for_what_they_name():
    asked = {re.split(r"[<>=\[]", each)[0] for each in requirements(["all"])}
    assert {"hatchling", "editables", "jax", "viser", "starlette", "optuna"} <= asked
    assert not {"motorgrad", "ray", "pytest"} & asked
