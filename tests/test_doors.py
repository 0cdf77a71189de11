"""Doors that must not jam: names work in Python as on the command line, and pages say what the library does."""

import pytest

import motorgrad as mg
from motorgrad.training import NotTrusted, RunDirectoryError
from tools.install import requirements


def test_everything_has_pandas_for_to_pandas():
    assert any(each.startswith("pandas") for each in requirements(["all"])[0])


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
        assert numbers.stated_in(claim) is not None, claim.sentence
        assert max(claim.blocks, default=-1) < len(numbers.python_in(claim.page))


def test_the_gallery_says_how_long_its_films_learn():
    from tools import documented_numbers as numbers
    from tools.figures import films

    assert set(numbers.FILMS) == set(films.DECISIONS)
    assert numbers.main(["docs/gallery.md"]) == 0
