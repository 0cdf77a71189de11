"""Run directories whose files say what no run says, with checksums that are right: one line, and no trace of Python."""

import copy
import io
import json
import shutil

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

import motorgrad as mg
from motorgrad._reading import content_of
from motorgrad.cli import main
from motorgrad.training.store import RunDirectory
from motorgrad.training.store._checkpoint import checksum
from motorgrad.training.store._directory import _sessions_checksum

STATE, INITIAL = "checkpoint/000000000020.state", "checkpoint/initial.policies"


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    folder = tmp_path_factory.mktemp("trained") / "run"
    mg.train("three-state", steps=20, seeds=2, window=1, out=folder, progress=False)
    return folder


@pytest.fixture
def run(trained, tmp_path):
    return shutil.copytree(trained, tmp_path / "run")


def said_in(path):
    """The facts in a checkpoint, and its arrays."""
    head, _, content = path.read_bytes().partition(b"\n")[2].partition(b"\n")
    with np.load(io.BytesIO(content)) as arrays:
        return json.loads(head), dict(arrays)


def forge(path, about, arrays):
    """Write a checkpoint with its checksum, which is returned."""
    content = io.BytesIO()
    np.savez(content, **arrays)
    body = json.dumps(about).encode() + b"\n" + content.getvalue()
    path.write_bytes(checksum(body).encode() + b"\n" + body)
    return checksum(body)


def refusal(capsys, *words):
    """What a command says as it refuses its input."""
    assert main([str(word) for word in words]) == 2
    said = capsys.readouterr().err.strip().splitlines()[-1]
    assert said.startswith(f"motorgrad {words[0]}: ")
    return said


def refused(path):
    """What `load` says as it refuses a run; `None` where it does not."""
    try:
        mg.load(path)
    except (ValueError, RuntimeError) as error:
        return str(error)
    return None


WRONG = [None, -1, 2**63, 1.5, float("nan"), "../x", [1], {"a": 1}]
PLACES = [
    *[(name,) for name in ("decision", "recorded", "wall", "config", "begins", "provenance", "initial", "versions")],
    *[("metrics",), ("metrics", "length"), ("metrics", "checksum"), ("provenance", "sessions")],
    *[("config", "run"), ("config", "run", "seeds"), ("config", "task"), ("begins", "structure")],
]


@pytest.mark.filterwarnings("ignore")
@pytest.mark.parametrize("place", PLACES, ids=".".join)
def test_a_fact_of_another_kind_is_refused_or_used_but_nothing_else(place, run):
    about, arrays = said_in(run / STATE)
    for wrong in [*WRONG, "left out"]:
        changed = copy.deepcopy(about)
        inner = changed
        for name in place[:-1]:
            inner = inner[name]
        if wrong == "left out":
            del inner[place[-1]]
        else:
            inner[place[-1]] = wrong
        forge(run / STATE, changed, arrays)
        said = refused(run)
        assert said is None or str(run) in said
        assert said is None or len(said.splitlines()) == 1


@pytest.mark.parametrize("short", [3, "x", [1, 2], ["../../x-1-2.parquet", "0"], ["1-2.parquet"]])
def test_the_file_of_an_unfinished_window_is_one_of_the_folder(short, run, capsys):
    about, arrays = said_in(run / STATE)
    forge(run / STATE, {**about, "short": short}, arrays)
    assert "short = " in refusal(capsys, "evaluate", run)


@pytest.mark.parametrize("name", ["x.state", "5.state", f"{'٣' * 12}.state"])
def test_other_files_beside_checkpoints_are_none(name, run):
    (run / "checkpoint" / name).write_bytes(b"x")
    assert mg.load(run).decision == 20


@pytest.mark.parametrize(
    "structure",
    [
        {"kind": "equinox.nn.Linear"},
        {"kind": "list", "items": 3},
        {"kind": ["x"]},
        {"weights": "float32[2,2]"},
        {"kind": "motorgrad.policies.Softmax", "weights": "float32[2,3]"},
        {"kind": "motorgrad.policies.Softmax", "weights": "nothing[2,2]"},
        {"kind": "motorgrad.policies.Softmax", "weights": {"kind": "dict", "keys": [[]], "items": [1]}},
    ],
)
def test_a_policy_of_another_structure_than_its_arrays_is_refused(structure, run, capsys):
    about, arrays = said_in(run / INITIAL)
    about["learner"]["structure"] = structure
    initial = forge(run / INITIAL, about, arrays)
    facts, state = said_in(run / STATE)
    forge(run / STATE, {**facts, "initial": initial}, state)
    assert str(run) in refusal(capsys, "evaluate", run)


@pytest.mark.parametrize(
    "wrong", [np.zeros(3, np.float32), np.zeros((2, 2, 2)), np.zeros((3, 2, 2), np.float32), np.full((2, 2, 2), "x")]
)
def test_arrays_of_other_shapes_and_types_are_refused(wrong, run, capsys):
    about, arrays = said_in(run / STATE)
    place = str(about["names"].index("kept.weights"))
    forge(run / STATE, about, {**arrays, place: wrong})
    assert "kept.weights: found " in refusal(capsys, "evaluate", run)


def with_column(table, name, column):
    return table.set_column(table.column_names.index(name), name, column)


RECORDS = {
    "no decisions": lambda table: table.drop_columns(["decision"]),
    "no times": lambda table: table.drop_columns(["wall_time"]),
    "texts": lambda table: with_column(table, "reward", pa.array(["x"] * table.num_rows)),
    "gaps": lambda table: with_column(table, "reward", pa.array([None] * table.num_rows, pa.float32())),
    "a text for a seed": lambda table: with_column(table, "seed", pa.array(["x"] * table.num_rows)),
    "texts for parameters": lambda table: with_column(table, "parameters", pa.array(["x"] * table.num_rows)),
    "another text": lambda table: table.append_column("more", pa.array(["x"] * table.num_rows)),
    "one twice": lambda table: table.append_column("reward", table["reward"]),
    "a row too few": lambda table: table[:-1],
}


@pytest.mark.parametrize("name", RECORDS)
def test_records_of_other_columns_are_refused(name, run, capsys):
    (file,) = (run / "metrics").glob("*.parquet")
    pq.write_table(RECORDS[name](pq.read_table(file)), file)
    line = f"{checksum(file.read_bytes())}  {file.name}\n".encode()
    (run / "metrics" / "SHA256SUMS").write_bytes(line)
    about, arrays = said_in(run / STATE)
    forge(run / STATE, {**about, "metrics": {"length": len(line), "checksum": checksum(line)}}, arrays)
    assert str(run) in refusal(capsys, "plot", run, "--out", run / "x.png")


@pytest.mark.parametrize("session", ["x", {"versions": 3, "processor": 1}, {"versions": {}}])
def test_sessions_that_are_none_are_set_aside(session, run):
    (run / "provenance.json").write_text(json.dumps({"seeds": [0, 1], "sessions": [session]}))
    about, arrays = said_in(run / STATE)
    mark = _sessions_checksum([0, 1], [session])
    forge(run / STATE, {**about, "provenance": {"sessions": 1, "checksum": mark}}, arrays)
    with pytest.warns(mg.training.RunWarning, match=r"provenance\.json: damaged.*set aside"):
        mg.resume(run, progress=False)
    assert "processor" in json.loads((run / "provenance.json").read_text())["sessions"][0]


@pytest.mark.parametrize("name", [STATE, INITIAL, "metrics/SHA256SUMS"])
def test_a_folder_in_the_place_of_a_file_is_named(name, run):
    (run / name).unlink()
    (run / name).mkdir()
    with pytest.raises(IsADirectoryError, match=str(run / name)):
        mg.load(run)
    with pytest.raises(IsADirectoryError, match=str(run)):
        content_of(run, 1000)


def test_a_restored_environment_that_fails_is_named_and_told_in_one_line(tmp_path):
    task = mg.tasks.from_gymnasium("CartPole-v1")
    batch = task.batch([0])
    kept = batch.snapshot()
    stored = json.loads(kept["environments"][0])
    stored["fields"]["_elapsed_steps"] = "x"
    kept["environments"] = np.array([json.dumps(stored, separators=(",", ":")).encode()])
    batch.restore(kept)
    told = r"^CartPole-v1 fails after it was restored from a checkpoint: in step 1 .*: TypeError: "
    with pytest.raises(RuntimeError, match=told):
        batch.step(np.zeros((1, 1)))


def test_a_directory_without_a_checkpoint_and_with_other_sessions_is_refused(run):
    shutil.rmtree(run / "checkpoint")
    (run / "provenance.json").write_text("[]")
    with pytest.raises(ValueError, match=r"provenance\.json: holds no list of sessions"):
        mg.train("three-state", steps=20, seeds=2, window=1, out=run, progress=False)
    assert RunDirectory(run).is_run
