"""A flipped bit anywhere in a run directory is named, and made good where a checkpoint allows it; a setting changed by
hand is refused by name."""

import hashlib
import json
import re
import shutil
import warnings

import numpy as np
import pyarrow as pa
import pytest
from training_examples import NEVER, assert_same_run, checkpoints, columns

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.training import RunDirectoryError, RunWarning
from motorgrad.training.store import CorruptCheckpoint, RunDirectory, _directory

OPTIONS = {"seeds": 2, "window": 40, "threads": 1, "checkpoint_every": NEVER, "progress": False}
LEGS = (120, 200, 260)  # the last record is of an unfinished window
OLD, NEW, SHORT = (f"metrics/{a:012d}-{b:012d}.parquet" for a, b in ((160, 200), (240, 240), (260, 260)))
FILES = [
    "config.toml",
    "provenance.json",
    "metrics/SHA256SUMS",
    OLD,
    NEW,
    SHORT,
    "checkpoint/initial.policies",
    "checkpoint/000000000200.state",
    "checkpoint/000000000260.state",
]
FLIPS = 12  # of each file


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    path = tmp_path_factory.mktemp("made")
    for steps in LEGS:
        mg.train("three-state", steps=steps, out=path, **OPTIONS)
    return path


@pytest.fixture
def run(made, tmp_path):
    """A copy to damage."""
    return shutil.copytree(made, tmp_path / "run")


def go_on(path, steps=LEGS[-1], **options):
    return mg.train("three-state", steps=steps, out=path, **{**OPTIONS, **options})


def flip(file, bit):
    content = bytearray(file.read_bytes())
    content[bit // 8] ^= 1 << bit % 8
    file.write_bytes(content)


@pytest.mark.parametrize("name", FILES)
def test_a_flipped_bit_is_named(name, made, run):
    content, random = (made / name).read_bytes(), np.random.default_rng(FILES.index(name))
    for bit in random.integers(8 * len(content), size=FLIPS):
        flip(run / name, bit)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            try:
                mg.load(run)
            except (RunDirectoryError, CorruptCheckpoint) as error:
                told = str(error)
            else:
                told = " ".join(str(each.message) for each in said)
        assert (run / name).name in told, (bit, told)
        (run / name).write_bytes(content)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mg.load(run)


def test_every_file_is_in_this_test(made):
    found = {str(file.relative_to(made)) for file in made.rglob("*") if file.is_file()}
    assert found - {".lock", ".signature"} == {*FILES, "metrics/000000000040-000000000120.parquet"}


@pytest.mark.parametrize("name", [name for name in FILES if name not in ("config.toml", OLD)])
def test_what_a_checkpoint_can_make_again_is(name, made, run):
    flip(run / name, 801)
    with warnings.catch_warnings(record=True):
        warnings.simplefilter("always")
        assert_same_run(go_on(run), mg.load(made))
    again = mg.load(run)  # and nothing is left to warn of
    assert_same_run(again, mg.load(made))


def test_records_that_no_checkpoint_can_make_again_are_left_out_and_said_each_time(made, run):
    flip(run / OLD, 801)
    for _ in range(2):
        with pytest.warns(RunWarning, match=rf"{OLD} is damaged.*decision 200"):
            found = mg.load(run)
        assert sorted(set(columns(found.metrics)["decision"])) == [40, 80, 120, 240, 260]
        with pytest.warns(RunWarning, match=rf"{OLD} is damaged.* unless you delete the folder checkpoint"):
            go_on(run)
    shutil.rmtree(run / "checkpoint")
    assert_same_run(go_on(run), mg.load(made))


def test_a_lost_file_of_records_is_named(run):
    (run / NEW).unlink()
    with pytest.warns(RunWarning, match=rf"{NEW} is missing; it has records up to decision 240"):
        mg.load(run)


def test_the_list_and_a_record_damaged_together_are_both_named(run):
    flip(run / "metrics/SHA256SUMS", 9)
    flip(run / NEW, 801)
    with pytest.warns(RunWarning) as said:
        mg.load(run)
    told = " ".join(str(each.message) for each in said)
    assert "SHA256SUMS is damaged" in told
    assert f"{NEW} is damaged" in told


def test_a_lost_configuration_is_that_of_the_checkpoint(made, run):
    (run / "config.toml").unlink()
    with pytest.warns(RunWarning, match=r"it has no config.toml; using the configuration in the newest checkpoint"):
        assert mg.load(run).config == mg.load(made).config
    with pytest.warns(RunWarning, match="using the configuration in the newest"):
        mg.resume(run, progress=False)
    assert (run / "config.toml").read_bytes() == (made / "config.toml").read_bytes()


def test_saving_costs_the_same_however_long_a_run_is(made, tmp_path):
    run, state = mg.load(made), {"numbers": np.zeros(9)}
    config, record = run.config, run.metrics[:1]
    place = record.column_names.index("decision")
    with RunDirectory(tmp_path) as directory:
        directory.write_config(config)
        directory.save_initial(state, {})
        directory.add_session([0], None, False)
        directory.roll_back(None)
        for decision in range(1, 100):
            about = {"decision": decision, "recorded": decision, "config": config}
            directory.save(state, about, record.set_column(place, "decision", pa.array([decision])))
        assert checkpoints(tmp_path)[-1].stat().st_size < 5_000
        assert directory.metrics()["decision"].to_pylist() == [*range(1, 100)]
    sums = (tmp_path / "metrics" / "SHA256SUMS").read_text().splitlines()
    assert len(sums) == 99
    name = "000000000007-000000000007.parquet"
    assert sums[6] == f"{hashlib.sha256((tmp_path / 'metrics' / name).read_bytes()).hexdigest()}  {name}"


# ---- settings


def change(file, old, new):
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new, 1))


CHANGES = {
    "seeds": (
        "seeds = [\n    0,\n    1,\n]",
        "seeds = [\n    0,\n    7,\n]",
        r"run.seeds is \[0, 7\], and was \[0, 1\]",
    ),
    "trace": ("decay = 0.8", "decay = 0.7", r"agent.estimator.trace.decay is 0.7, and was 0.8"),
    "window": ("window = 40", "window = 41", "run.window is 41, and was 40"),
    "task": ("[task]\n", "[task]\nnothing = 3\n", "task.nothing is 3, and was None"),
}


@pytest.mark.parametrize("kind", CHANGES)
def test_a_setting_changed_by_hand_is_refused_by_name(kind, run, capsys):
    old, new, named = CHANGES[kind]
    change(run / "config.toml", old, new)
    kept = {file: file.read_bytes() for file in run.rglob("*") if file.is_file()}
    for call in (mg.load, mg.evaluate, mg.resume, go_on):
        with pytest.raises(
            RunDirectoryError, match=rf"config.toml: {named} when .*: put it back, or .*allow_changed=True"
        ):
            call(run)
    for command in (["train", "--resume"], ["evaluate"], ["plot"], ["sim", "--run"]):
        assert main([*command, str(run)]) == 2
        assert re.search(named, capsys.readouterr().err)
    assert {file: file.read_bytes() for file in kept} == kept


@pytest.mark.ci
def test_the_armature_of_a_body_is_bound_to_its_checkpoint(tmp_path):
    mg.train("hopper", steps=4, out=tmp_path, **OPTIONS)
    armature = mg.load(tmp_path).config["task"]["body"]["armature"]
    change(tmp_path / "config.toml", f"armature = {armature}", f"armature = {10 * armature}")
    told = rf"task.body.armature is {10 * armature}, and was {armature} when"
    for call in (mg.load, mg.evaluate, mg.resume):
        with pytest.raises(RunDirectoryError, match=told):
            call(tmp_path)
    with pytest.warns(RunWarning, match=told):
        assert mg.load(tmp_path, allow_changed=True).task.body.armature == 10 * armature
    with pytest.warns(RunWarning, match=told):
        changed = mg.resume(tmp_path, 8, progress=False, allow_changed=True)
    assert changed.task.body.armature == 10 * armature
    assert mg.load(tmp_path).config == changed.config  # the present settings are now those of the checkpoint


def test_a_setting_is_changed_on_purpose_on_the_command_line(run, capsys):
    change(run / "config.toml", *CHANGES["trace"][:2])
    command = ["train", "--resume", str(run), "--steps", "300", "--allow-changed"]
    with pytest.warns(RunWarning, match=CHANGES["trace"][2]):
        assert main(command) == 0
    assert mg.load(run).config["agent"]["estimator"]["trace"]["decay"] == 0.7
    assert "saved in" in capsys.readouterr().out


def test_a_call_with_other_settings_is_refused_or_meant(run):
    with pytest.raises(RunDirectoryError, match=r"decay was 0.8 and is now 0.5; .* on purpose with allow_changed=True"):
        go_on(run, 300, agent={"decay": 0.5})
    go_on(run, 300, agent={"decay": 0.5}, allow_changed=True)
    assert mg.load(run).config["agent"]["estimator"]["trace"]["decay"] == 0.5


def test_other_steps_in_the_file_are_said_and_obeyed(run):
    change(run / "config.toml", "steps = 260", "steps = 300")
    with pytest.warns(RunWarning, match="run.steps is 300, and was 260"):
        assert mg.resume(run, progress=False).decision == 300


@pytest.mark.parametrize(
    ("name", "version", "refused"),
    [("motorgrad", "0.0.9", True), ("motorgrad", None, False), ("jax", "0.0.1", False), ("mujoco", "3.1.0", False)],
)
def test_another_release_is_refused_and_other_versions_are_said(name, version, refused, tmp_path, monkeypatch):
    told = _directory.provenance()
    if version is None:  # another patch
        version = ".".join([*told["versions"][name].split(".")[:2], "99"])
    now, told["versions"] = told["versions"], {**told["versions"], name: version}
    with monkeypatch.context() as then:
        then.setattr(_directory, "provenance", lambda: told)
        then.setattr(_directory, "versions", lambda: told["versions"])
        go_on(tmp_path, 40)
    said = f"{name} was {version} and is now {now[name]}"
    if refused or name == "mujoco":
        with pytest.warns(RunWarning, match=f"{said}: what it computes may differ"):
            mg.load(tmp_path)
    else:
        mg.load(tmp_path)  # patches, and what has no part in an evaluation
    mg.load(tmp_path, allow_changed=True)
    if refused:
        with pytest.raises(
            RunDirectoryError, match=rf"{said}; continue it with that version, or on purpose with allow_"
        ):
            go_on(tmp_path, 80)
    with pytest.warns(RunWarning, match=f"continues, but not bit for bit: {said}"):
        go_on(tmp_path, 80, allow_changed=refused)


def test_a_checkpoint_says_what_it_belongs_to(made):
    head = json.loads(checkpoints(made)[-1].read_bytes().split(b"\n", 2)[1])
    assert head["config"] == mg.load(made).config
    assert {"motorgrad", "jax", "mujoco"} <= set(head["versions"])
    assert head["begins"]["initial"]
