"""Damaged run directories: damage is noticed and said, the checkpoint before it used, and the run ends the same."""

import shutil
import tomllib

import numpy as np
import pytest
from training_examples import NEVER, assert_same, assert_same_run, checkpoints

import motorgrad as mg
from motorgrad._files import write_atomically
from motorgrad.training import RunDirectoryError, RunWarning
from motorgrad.training.store._checkpoint import CorruptCheckpoint, fill_tree, load, save

FIRST, LAST = 120, 200
OPTIONS = {"seeds": 2, "window": 40, "threads": 1, "checkpoint_every": NEVER, "progress": False}


@pytest.fixture(scope="module", params=["three-state", pytest.param("hopper", marks=pytest.mark.ci)])
def made(request, tmp_path_factory):
    """A run in two legs, with a checkpoint and a file of metrics from each."""
    path = tmp_path_factory.mktemp(request.param)
    for steps in (FIRST, LAST):
        mg.train(request.param, steps=steps, out=path, **OPTIONS)
    assert [int(file.stem) for file in checkpoints(path)] == [FIRST, LAST]
    assert [file.stem for file in sorted((path / "metrics").glob("*.parquet"))] == [
        "000000000040-000000000120",
        "000000000160-000000000200",
    ]
    return path


@pytest.fixture
def damaged(made, tmp_path):
    """A copy to damage."""
    return shutil.copytree(made, tmp_path / "run")


def go_on(path):
    name = tomllib.loads((path / "config.toml").read_text())["task"]["name"]
    return mg.train(name, steps=LAST, out=path, **OPTIONS)


def truncate(file):
    file.write_bytes(file.read_bytes()[:-100])


def empty(file):
    file.write_bytes(b"")


def flip(place):
    def flip_bit(file):
        content = bytearray(file.read_bytes())
        content[round(place * (len(content) - 1))] ^= 0x10
        file.write_bytes(content)

    return flip_bit


DAMAGE = {
    "truncated": truncate,
    "empty": empty,
    "flipped in the checksum": flip(0.0),
    "flipped in the middle": flip(0.5),
    "flipped at the end": flip(1.0),
}


@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_checkpoint_is_said_and_the_one_before_it_used(kind, made, damaged):
    newest = checkpoints(damaged)[-1]
    DAMAGE[kind](newest)
    with pytest.warns(RunWarning, match=rf"{newest.name}: .*; using the checkpoint before it") as said:
        run = mg.load(damaged)
    assert len(said) == 1
    assert run.decision == FIRST
    assert max(run.metrics["decision"].to_pylist()) == FIRST
    with pytest.warns(RunWarning, match=r"using the checkpoint before it"):
        again = go_on(damaged)
    assert_same_run(again, mg.load(made))
    assert_same_run(mg.load(damaged), mg.load(made))


def test_a_deleted_checkpoint_is_made_again(made, damaged):
    checkpoints(damaged)[-1].unlink()
    assert mg.load(damaged).decision == FIRST
    assert_same_run(go_on(damaged), mg.load(made))


def test_without_any_whole_checkpoint_nothing_is_thrown_away_unasked(made, damaged):
    for file, harm in zip(checkpoints(damaged), (truncate, empty), strict=True):
        harm(file)
    kept = {path: path.read_bytes() for path in damaged.rglob("*") if path.is_file() and not path.name.startswith(".")}
    for use in (mg.load, go_on):
        with (
            pytest.warns(RunWarning, match="using the checkpoint before it"),
            pytest.raises(RunDirectoryError, match=r"there is none before it. Delete the folder .*checkpoint"),
        ):
            use(damaged)
    assert {path: path.read_bytes() for path in kept} == kept
    shutil.rmtree(damaged / "checkpoint")
    assert_same_run(go_on(damaged), mg.load(made))


def test_metrics_beyond_the_checkpoint_are_made_again(made, damaged):
    # As a run that was killed between its records and its state: the records are ahead.
    checkpoints(damaged)[-1].unlink()
    ahead = damaged / "metrics" / "000000000160-000000000200.parquet"
    ahead.write_bytes(b"of another life")
    assert_same_run(go_on(damaged), mg.load(made))


def test_what_was_being_written_when_it_was_killed_is_no_part_of_the_run(made, damaged):
    for folder, name in (("checkpoint", "000000000240.state"), ("metrics", "000000000240-000000000240.parquet")):
        (damaged / folder / f".{name}.partial").write_bytes(b"half of")
    assert_same_run(mg.load(damaged), mg.load(made))
    assert_same_run(go_on(damaged), mg.load(made))


def test_initial_policies_that_are_damaged_are_said(damaged):
    truncate(damaged / "checkpoint" / "initial.policies")
    with pytest.raises(CorruptCheckpoint, match=r"initial\.policies: the checksum does not match"):
        mg.load(damaged)


TREE = {"a": np.arange(6, dtype=np.float32).reshape(2, 3), "b": (np.array(7), np.array([np.nan, -0.0]))}


def test_a_checkpoint_gives_back_every_bit(tmp_path):
    save(tmp_path / "x.state", TREE, {"decision": 5})
    arrays, about = load(tmp_path / "x.state")
    assert about["decision"] == 5
    back = fill_tree(TREE, arrays)
    assert_same(back, TREE)
    assert np.signbit(back["b"][1][1])
    assert back["a"].dtype == np.float32
    assert [path.name for path in tmp_path.iterdir()] == ["x.state"]


@pytest.mark.parametrize(
    ("wanted", "named"),
    [
        ({**TREE, "a": np.zeros((2, 4), np.float32)}, r"checkpoint: a: found float32\(2, 3\), but .* float32\(2, 4\)"),
        ({**TREE, "a": np.zeros((2, 3))}, r"checkpoint: a: found float32\(2, 3\), but .* float64\(2, 3\)"),
        ({**TREE, "c": np.zeros(2)}, r"checkpoint: c: found nothing"),
    ],
)
def test_a_checkpoint_of_another_shape_is_refused_by_the_name_of_the_array(wanted, named, tmp_path):
    save(tmp_path / "x.state", TREE, {})
    with pytest.raises(ValueError, match=named):
        fill_tree(wanted, load(tmp_path / "x.state")[0])


def test_a_checkpoint_of_another_format_is_refused(tmp_path):
    save(tmp_path / "x.state", TREE, {"format": 99})
    with pytest.raises(ValueError, match="format 99: this version of motorgrad reads format 2"):
        load(tmp_path / "x.state")


def test_a_file_is_replaced_whole(tmp_path):
    write_atomically(tmp_path / "x", b"old and longer")
    write_atomically(tmp_path / "x", b"new")
    assert (tmp_path / "x").read_bytes() == b"new"
    assert len(list(tmp_path.iterdir())) == 1
