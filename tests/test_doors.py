"""Doors that must not jam: what installs has its pages, names work in Python as on the command line."""

import importlib.util
import os
import tomllib
from pathlib import Path

import pytest

import motorgrad as mg
from motorgrad.training import NotTrusted, RunDirectoryError

ROOT = Path(__file__).parents[1]


@pytest.fixture
def builder(monkeypatch, tmp_path):
    """`tools/build_editor.py`, whose pages and sources are in an empty folder."""
    from tools import build_editor

    sources, built = tmp_path / "frontend", tmp_path / "static" / "index.html"
    sources.mkdir()
    (sources / "index.html").write_text("source")
    icons = tmp_path / "icons.json"
    icons.write_text("{}")
    for name, value in {"SOURCES": sources, "BUILT": built, "ICONS": icons}.items():
        monkeypatch.setattr(build_editor, name, value)
    return build_editor


def test_pages_are_outdated_where_missing_or_older_than_a_source(builder):
    assert builder.outdated()
    builder.BUILT.parent.mkdir()
    builder.BUILT.write_text("built")
    for source, age in ((builder.ICONS, 10), (builder.SOURCES / "index.html", 10), (builder.BUILT, 10)):
        os.utime(source, (age, age))
    assert not builder.outdated()  # as in a source distribution, all of whose files are one age
    os.utime(builder.SOURCES / "index.html", (11, 11))
    assert builder.outdated()


def hook(builder, monkeypatch):
    spec = importlib.util.spec_from_file_location("hatch_build_tested", ROOT / "tools" / "hatch_build.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    monkeypatch.setattr(module, "build_editor", builder)
    told = []
    made = module.EditorPages.__new__(module.EditorPages)
    monkeypatch.setattr(
        module.EditorPages, "app", property(lambda _: type("App", (), {"display_warning": told.append}))
    )
    return made, told


def test_a_build_without_pages_fails_and_an_installation_warns(builder, monkeypatch):
    made, told = hook(builder, monkeypatch)
    monkeypatch.setenv("PATH", "/nowhere")  # no Node
    monkeypatch.delenv("PIP_BUILD_TRACKER", raising=False)
    assert made.dependencies() == [builder.PACKAGED]
    with pytest.raises(RuntimeError, match=r"pages of TimLab's editor could not be built: .*Node\.js 20\.19 or later"):
        made.initialize("standard", {})
    monkeypatch.setenv("PIP_BUILD_TRACKER", "/tmp/tracker")
    made.initialize("standard", {})
    assert "Everything but `motorgrad lab` works" in told[0]
    made.initialize("editable", {})  # which has those of the checkout
    assert len(told) == 1


def test_everything_has_pandas_for_to_pandas():
    extras = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]
    named = extras["all"][0].partition("[")[2].rstrip("]").split(",")
    assert any(each.startswith("pandas") for name in named for each in extras[name])


@pytest.mark.ci  # TimLab is large
def test_the_message_about_missing_pages_names_the_checkout():
    from motorgrad.lab.editor._static import NOT_BUILT

    assert str(ROOT) in NOT_BUILT


def test_a_gymnasium_id_names_a_task_as_on_the_command_line():
    assert mg.make("Pendulum-v1", repeat=2) == mg.tasks.Gymnasium("Pendulum-v1", repeat=2)
    from motorgrad.training import check_training

    task, agent = check_training("Pendulum-v1", steps=1000)[:2]
    assert task == mg.make("Pendulum-v1")
    assert mg.training.agent_table(agent) == mg.training.agent_table(mg.agent_for(task, steps=1000))
    with pytest.raises(ValueError, match="unknown task 'pendulm'"):
        mg.make("pendulm")


def test_a_file_that_names_code_is_not_imported_unasked(tmp_path):
    file = tmp_path / "task.toml"
    file.write_text('name = "gymnasium"\nenv_id = "unheard_of_module:Thing-v0"\n')
    with pytest.raises(NotTrusted, match="imports 'unheard_of_module:Thing-v0'"):
        mg.train(str(file), steps=10, progress=False)
    with pytest.raises(NotTrusted, match="another_module:Thing-v0"):  # a study's file may have the id for a name
        mg.training.check_imports({"name": "another_module:Thing-v0"}, "study.toml")
    file.write_text('name = "chain"\nlength = 4\n')
    assert mg.train(str(file), steps=10, progress=False).task.length == 4


@pytest.mark.parametrize(
    ("changes", "named"),
    [
        ({"seeds": 3}, r"run\.seeds was \[0\] and is now \[0, 1, 2\]"),
        ({"agent": {"metric": "fisher"}}, r"agent\.metric was 'none' and is now"),
        ({"task": "chain"}, r"task\.name was 'three-state' and is now 'chain'"),
    ],
)
def test_a_change_with_which_a_run_cannot_go_on_is_named(changes, named, tmp_path):
    mg.train("three-state", steps=20, out=tmp_path, progress=False)
    given = {"task": "three-state", "steps": 40, "out": tmp_path, "progress": False, "allow_changed": True} | changes
    with pytest.raises(RunDirectoryError, match=f"cannot be continued with these changes: .*{named}"):
        mg.train(**given)
    assert mg.load(tmp_path).decision == 20  # nothing was touched


def test_numbers_are_compared_by_the_digits_of_the_page(tmp_path, monkeypatch, capsys):
    from tools import documented_numbers as numbers

    assert numbers.agrees("0.81", 0.8149)
    assert not numbers.agrees("0.81", 0.8151)
    assert numbers.agrees("1,200", 1200.4)
    page = "Seven\nis {}, says nobody (commit 00000000).\n\n```python\nseven = 7.04\n```\n"
    claim = numbers.Claim("page.md", (0,), "Seven is {seven}, says nobody (commit {commit}).", {"seven": "seven"})
    monkeypatch.setattr(numbers, "ROOT", tmp_path)
    monkeypatch.setattr(numbers, "CLAIMS", (claim,))
    (tmp_path / "page.md").write_text(page.format("7.0"))
    assert numbers.main([]) == 0
    (tmp_path / "page.md").write_text(page.format("7.1"))
    assert numbers.main([]) == 1
    assert "seven: the page says 7.1, the run gives 7.04" in capsys.readouterr().out
    (tmp_path / "page.md").write_text("nothing")
    assert numbers.main([]) == 1


def test_the_pages_say_what_is_compared():
    from tools import documented_numbers as numbers

    for claim in numbers.CLAIMS:
        assert numbers.told_in(claim) is not None, claim.sentence
        assert max(claim.blocks, default=-1) < len(numbers.python_in(claim.page))


def test_the_gallery_says_how_long_its_films_learn():
    from tools import documented_numbers as numbers
    from tools.figures import films

    assert set(numbers.FILMS) == set(films.DECISIONS)
    assert numbers.main(["docs/gallery.md"]) == 0
