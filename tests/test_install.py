"""Installing the four packages in the tested versions: files are what `hashes.txt` says, or nothing is installed."""

import itertools
import re
import tomllib
from pathlib import Path

import pytest
from packaging.requirements import Requirement

import motorgrad
from tools.hashes import pins
from tools.install import PACKAGES, ROOT, all_known, hashes, normal, requirements

PROJECTS = {folder: tomllib.loads((ROOT / folder / "pyproject.toml").read_text()) for folder in PACKAGES}
TOPIC = "Topic :: Scientific/Engineering :: Artificial Intelligence"


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
    wanted, folders = requirements(["all"])
    asked = {normal(Requirement(each).name) for each in wanted}
    assert {"hatchling", "editables", "jax", "viser", "starlette", "optuna"} <= asked
    assert not {"motorgrad", "timsim", "timlab", "motorgrad-thesis", "ray", "pytest"} & asked
    assert folders[0] == ROOT
    assert set(folders) == {ROOT / folder for folder in PACKAGES}


@pytest.mark.parametrize(
    ("extras", "reached"),
    [
        ([], []),
        (["sim"], ["apps/timsim"]),
        (["lab"], ["apps/timlab"]),
        (["thesis"], ["apps/timsim", "thesis"]),
        (["video", "pandas"], ["apps/timsim"]),
        (["fmi", "dev"], ["apps/timlab"]),
    ],
    ids=",".join,
)
def test_an_extra_reaches_no_more_packages_than_it_needs(extras, reached):
    wanted, folders = requirements(extras)
    assert sorted(folder.relative_to(ROOT).as_posix() for folder in folders) == sorted([".", *reached])
    asked = {normal(Requirement(each).name) for each in wanted}
    assert ("viser" in asked) == ("apps/timsim" in reached)
    assert ("starlette" in asked) == ("apps/timlab" in reached)


def test_the_packages_are_in_step():
    library = PROJECTS["."]["project"]
    own = {project["project"]["name"] for project in PROJECTS.values()}
    assert library["version"] == motorgrad.__version__
    assert f"\nversion: {library['version']}\n" in (ROOT / "CITATION.cff").read_text()
    for folder, whole in PROJECTS.items():
        project = whole["project"]
        for name in ("version", "requires-python", "license", "license-files", "readme"):
            assert project[name] == library[name], folder
        assert set(project["classifiers"]) <= set(library["classifiers"]) <= {*project["classifiers"], TOPIC}, folder
        assert (ROOT / folder / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes(), folder
        extras = project.get("optional-dependencies", {}).values()
        for each in map(Requirement, [*project["dependencies"], *itertools.chain(*extras)]):
            pin = "" if each.name == project["name"] else f"=={library['version']}"
            assert each.name not in own or str(each.specifier) == pin, (folder, str(each))
        (package,) = whole["tool"]["hatch"]["build"]["targets"]["wheel"]["packages"]
        assert (ROOT / folder / package / "py.typed").exists(), folder
