"""The stored speed table: the page is drawn from it, every row is in it, and commits are compared side by side."""

import dataclasses
import json
import re
import subprocess
from pathlib import Path

import pytest

from motorgrad.benchmarks import Figures, Goal, Row, Took, figures, speed_table

ROOT = Path(__file__).parents[2]
PAIRS = [(Took(10, 2.0, 1.0), Took(10, 1.0, 1.0)), (Took(10, 4.0, 1.0), Took(10, 1.0, 2.0))]
MACHINE = {"processor": "Abacus", "cores": 2, "versions": {"python": "3.11"}}


def never(quick, pairs):
    raise AssertionError


ROWS = [Row("one", "one ÷ other", never, Goal(0.4)), Row("two", "a second row", never)]


def as_json(found):
    return json.loads(json.dumps(dataclasses.asdict(found)))


@pytest.fixture(scope="module")
def speed():
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(ROOT))
        import tools.speed.__main__

        yield tools.speed


@pytest.fixture
def folder(speed, tmp_path, monkeypatch):
    monkeypatch.setattr(speed._store, "FOLDER", tmp_path)
    monkeypatch.setattr(speed._store, "present", lambda: ("12345678", True))
    return tmp_path


@pytest.mark.needs("motorgrad[sim]")
@pytest.mark.needs("motorgrad[lab]")
def test_the_page_is_drawn_from_what_is_stored_of_every_row(speed):
    rows = list(speed_table())
    assert speed._store.page(rows) == speed._store.PAGE.read_text(encoding="utf-8"), "run `python -m tools.speed draw`"
    known = speed._store.stored()
    assert known.keys() <= {row.id for row in rows}, "remove the files of former rows"
    drawn = speed._store.table(rows)
    for row in rows:
        (line,) = (line for line in drawn.splitlines() if line.startswith(f"| `{row.id}`: "))
        assert (speed._store.NOT_MEASURED in line) == (row.id not in known)
    for name, entry in known.items():
        assert entry["id"] == name
        assert {"commit", "changed", "date", "machine"} <= entry.keys()
        Figures(**entry["figures"])


def test_a_row_is_stored_and_drawn_with_its_commit(speed, folder):
    speed._store.store(ROWS[0], {"figures": as_json(figures("u/s", PAIRS)), "machine": MACHINE})
    entry = json.loads((folder / "one.json").read_text())
    assert entry["figures"]["pairs"][1][1] == {"amount": 10, "wall": 1.0, "cpu": 2.0}
    first, second = speed._store.table(ROWS).splitlines()[2:4]
    when = r"`12345678` with changes, \d{4}-\d\d-\d\d, A"
    ratios = r"0.38 \[0.25 … 0.50\] \| 1.50 \[1.00 … 2.00\]"
    assert re.fullmatch(rf"\| `one`: one ÷ other \| 3.75 u/s \| 10 \| {ratios} \| ≥ 0.4, missed \| {when} \|", first)
    assert second == "| `two`: a second row | not measured yet |  |  |  |  |  |"
    assert speed._store.table(ROWS).endswith("A: Abacus, 2 cores; python 3.11.")


def test_figures_of_other_words_do_not_count_and_those_of_former_rows_are_named(speed, folder):
    for row in ROWS:
        speed._store.store(row, {"figures": as_json(figures("u/s", PAIRS)), "machine": MACHINE})
    drawn = speed._store.table([Row("one", "one ÷ a third", never)])
    assert "| `one`: one ÷ a third | not measured yet |" in drawn
    assert "`two` is stored, but is no longer a row." in drawn


@pytest.mark.parametrize(
    ("ratios", "fell"),
    [
        ((0.80, 0.81, 0.82), True),
        ((0.80, 0.90, 1.00), False),
        ((0.98, 1.00, 1.01), False),
        ((1.2, 1.3, 1.4), False),
        ((0.97, 0.975, 0.98), True),
    ],
)
def test_a_row_fell_by_more_than_its_spread(speed, ratios, fell):
    assert speed._check.Change("row", ratios).fell == fell


def test_commits_are_measured_in_turn_and_what_fell_is_named(speed, monkeypatch, tmp_path, capsys):
    measured = []

    def measure(checkout, row_id, pairs):
        measured.append((row_id, "base" if checkout == tmp_path else "new"))
        if row_id == "two" and checkout == tmp_path:
            raise speed._check.Failed("ImportError: no such name")
        return {"costs": [1.0, 1.0] if checkout == tmp_path else [2.0, 2.0]}

    class Base:
        def __enter__(self):
            return tmp_path

        def __exit__(self, *error):
            pass

    monkeypatch.setattr(speed._check, "measure", measure)
    monkeypatch.setattr(speed._check, "base_checkout", lambda base: Base())
    monkeypatch.setattr(speed._check, "present", lambda: ("12345678", False))
    monkeypatch.setattr(speed._check, "git", lambda *words: "87654321")
    assert speed._check.check("old", ROWS, 2) == 1
    assert measured == [*[("one", "base"), ("one", "new")] * 2, ("two", "base")]
    said = capsys.readouterr().out
    assert "one: new ÷ base 0.50 [0.50 … 0.50], FELL" in said
    assert "two: not compared: base: ImportError: no such name" in said
    assert said.endswith("failed: one\n")
    assert speed._check.check("old", ROWS[1:], 2) == 0


def test_a_base_is_a_commit_with_the_rows_of_this_checkout(speed, tmp_path, monkeypatch):
    here = tmp_path / "here"
    rows = here / "src" / "motorgrad" / "benchmarks"
    rows.mkdir(parents=True)

    def git(*words, checkout=here):
        who = ("-c", "user.name=a", "-c", "user.email=a@b")
        done = subprocess.run(["git", *who, *words], cwd=checkout, check=True, capture_output=True, text=True)
        return done.stdout.strip()

    git("init", "-q")
    for name in ("library", "benchmarks/gone"):
        (here / "src" / "motorgrad" / f"{name}.py").write_text("before")
    git("add", "-A")
    git("commit", "-qm", "before")
    (here / "src" / "motorgrad" / "library.py").write_text("after")
    (rows / "gone.py").rename(rows / "new.py")
    git("commit", "-qam", "after")
    monkeypatch.setattr(speed._check, "git", git)
    monkeypatch.setattr(speed._check, "ROOT", here)
    with speed._check.base_checkout("HEAD~1") as base:
        assert (base / "src" / "motorgrad" / "library.py").read_text() == "before"
        assert [path.name for path in (base / "src" / "motorgrad" / "benchmarks").iterdir()] == ["new.py"]
        assert len(git("worktree", "list").splitlines()) == 2
    assert len(git("worktree", "list").splitlines()) == 1
    assert not base.exists()


def test_without_a_tag_there_is_nothing_to_compare_with(speed, monkeypatch, capsys):
    monkeypatch.setattr(speed.__main__, "git", lambda *words: "")
    monkeypatch.setattr(speed.__main__, "speed_table", lambda: ROWS)
    assert speed.__main__.main(["check"]) == 0
    assert "no tag yet" in capsys.readouterr().out
