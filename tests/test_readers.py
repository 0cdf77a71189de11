"""Every reader of strangers' files, under an audit hook: whatever is in a file, nothing runs, and nothing is written.

A file is refused with one of the product's own errors, in one line that names it, or read. Wrong checksums are made
right, as a stranger can.
"""

import json
import pickle
import random
import warnings
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from audit import mutations, nothing_happens, trap_module
from motorgrad.bodies.arm._lift import LiftTable
from motorgrad.search import Range, Space, Uniform
from motorgrad.search._search import _marks, _read
from motorgrad.studies import Results, Study, run_study
from motorgrad.studies._scores import _score_in
from motorgrad.training import RunDirectoryError
from reader_examples import MODEL, READERS, REFUSALS, Reader, written

COUNT = 60  # mutations of each file


class Evil:
    def __reduce__(self) -> Any:
        return exec, ("raise SystemExit('a pickle was run')",)


class Harmless:
    def __reduce__(self) -> Any:
        return dict, ()


@pytest.fixture
def good(request, tmp_path, monkeypatch) -> tuple[Reader, Path]:
    """A reader and a good file of its kind, which it has read once."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.syspath_prepend(str(tmp_path))
    reader = READERS[request.param]
    written("m.xml", MODEL)(tmp_path)
    file = reader.make(tmp_path)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        reader.read(file)
    return reader, file


def check_refusal(error: BaseException, reader: Reader, file: Path) -> None:
    """A refusal is an error of ours in one line, which names the file, or another beside it that does not fit it."""
    package = type(error).__module__.split(".")[0]
    ours = type(error) is ValueError or isinstance(error, OSError) or package in ("motorgrad", "timsim", "timlab")
    said = str(error)
    assert ours, repr(error)
    assert len(said.splitlines()) == 1, repr(error)
    assert reader.nameless or file.stem in said or str(Path.cwd()) in said, repr(error)


@pytest.mark.parametrize(
    "good",
    [pytest.param(name, marks=[pytest.mark.needs(each.needs)] if each.needs else []) for name, each in READERS.items()],
    indirect=True,
)
def test_whatever_is_in_a_file_nothing_happens(good, request, tmp_path, capsys):
    reader, file = good
    content, name = file.read_bytes(), trap_module(tmp_path)
    texts = [content.replace(b"CartPole-v1", each) for each in (b"os:system", f"{name}:X-v0".encode())]
    pickled = [pickle.dumps(Evil(), protocol) for protocol in (0, 2, 5)]
    chance = random.Random(request.node.name)
    refused = 0
    for changed in [*texts, *pickled, b"", b"\x80\x05", *mutations(content, COUNT, chance)]:
        file.write_bytes(changed)
        reader.finish(file)
        with warnings.catch_warnings(), nothing_happens():
            warnings.simplefilter("ignore")
            try:
                refused += reader.read(file) == 2
            except REFUSALS as error:
                refused += 1
                check_refusal(error, reader, file)
    assert refused
    capsys.readouterr()


def lifts(**arrays):
    """A stored table of lifts, some of whose arrays are others or missing (None)."""
    made = json.dumps({"arm": {}, "mujoco": "4", "seconds": 2.0, "heaviest": 20.0})
    whole = {"effort": np.ones(3), "height": np.ones((3, 4)), "made": made, **arrays}
    return {name: value for name, value in whole.items() if value is not None}


@pytest.mark.parametrize(
    ("arrays", "told"),
    [
        (lifts(made=None), "must be made, effort and height"),
        (lifts(made="[]"), "must be how the table was made"),
        (lifts(made='{"arm": {}, "seconds": 3.0}'), "seconds = 3.0: must be 2"),
        (lifts(effort=np.ones(2)), r"must be \(loads,\) and \(loads, shares\)"),
        (lifts(height=np.full((3, 4), np.nan)), "must be finite"),
        (lifts(effort=np.array(["a"] * 3)), "must be numbers"),
    ],
)
def test_a_table_that_says_something_else_is_refused_by_name(arrays, told, tmp_path):
    np.savez(tmp_path / "lift.npz", **arrays)
    with pytest.raises(ValueError, match=rf"lift\.npz: .*{told}"):
        LiftTable.load(tmp_path / "lift.npz")


@pytest.mark.parametrize("text", ["[]", "{}", '{"score": "3"}', '{"score": true}', "3"])
def test_a_score_that_is_none_is_refused_by_name(text, tmp_path):
    (tmp_path / "score.json").write_text(text)
    with pytest.raises(ValueError, match=r"score\.json: damaged: must say the score of a candidate"):
        _score_in(tmp_path / "score.json")


def test_a_search_without_its_scores_is_refused_by_name(tmp_path):
    space, file = Space({"x": Range(0.0, 1.0)}), tmp_path / "search.npz"
    marks = _marks(space, Uniform(), 0)
    mark = marks[0]
    whole = {"mark": mark, "candidates": np.zeros((2, 1)), "scores": np.zeros(2)}
    for changed in ({"scores": np.zeros(3)}, {"candidates": np.zeros((2, 2))}, {"scores": np.array(["a", "b"])}, {}):
        np.savez(file, **({**whole, **changed} if changed else {"mark": mark}))
        with pytest.raises(ValueError, match=r"search\.npz: damaged: must hold scores and as many candidates"):
            _read(file, marks, space)


def test_a_study_whose_settings_were_changed_after_it_ran_says_so(tmp_path):
    study = Study("three-state", {"learning_rate": 0.1}, steps=100, seeds=1, window=50)
    run_study(study, tmp_path / "study", progress=False)
    file = tmp_path / "study" / "study.toml"
    file.write_text(file.read_text().replace("seeds = 1", "seeds = 2"))
    with pytest.raises(RunDirectoryError, match=r"rows of settings and seeds = 1: must be 2, as study\.toml"):
        Results.load(tmp_path / "study")


def test_the_watch_sees_what_it_is_there_for(tmp_path):
    (tmp_path / "evil.pickle").write_bytes(pickle.dumps(Evil()))
    for act in (
        lambda: pickle.loads(pickle.dumps(Harmless())),
        lambda: (tmp_path / "new").write_text("x"),
        lambda: (tmp_path / "evil.pickle").unlink(),
        lambda: exec("1"),
        lambda: __import__("no_such_module"),
    ):
        with pytest.raises((AssertionError, ImportError)), nothing_happens():
            act()
