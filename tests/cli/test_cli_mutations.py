"""Ten thousand files and command lines that somebody, or something, has spoilt: an answer, or a refusal on one line."""

import contextlib
import copy
import io
import math
import resource
import tomllib
from datetime import timedelta
from pathlib import Path

import pytest
import tomli_w
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from motorgrad.cli import COMMANDS, main
from motorgrad.tasks import TASKS

SCENES = sorted((Path(__file__).parents[2] / "docs" / "scenes").glob("*.toml"))
MEMORY = 1.5e9  # bytes that all checks together may take more than the first: none makes what it checks
PATIENCE = timedelta(seconds=20)


def check(command, path):
    """The exit status of a command that only checks a file, and what it says on the two outputs."""
    return run_command(command, "--config", str(path), "--check")


def run_command(*arguments):
    """The exit status of a command, and what it says on the two outputs."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            status = main(list(arguments))
        except SystemExit as left:
            status = left.code
    return status, out.getvalue(), err.getvalue()


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """Files that are in order, of every command: `(command, table)`; and the folder that they speak of."""
    folder = tmp_path_factory.mktemp("sound")
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        runs = {name: folder / "runs" / name for name in ("chain", "hopper")}
        for name, path in runs.items():
            assert main(["train", name, "--steps", "20", "--out", str(path), "--json", str(folder / "x.json")]) == 0
        tables = [
            ("evaluate", {"run": str(runs["hopper"]), "steps": 20, "mode": "mode", "seconds": 0.5, "film": False}),
            ("plot", {"runs": [str(path) for path in runs.values()], "out": "curve.svg"}),
            ("reproduce", {"experiments": ["all"], "quick": True}),
            ("demo", {"out": "demo", "seconds": 10.0, "seeds": 2}),
            ("bench", {"quick": True}),
            ("completion", {"shell": "bash"}),
            ("export", {"run": str(runs["hopper"]), "file": "policy.c"}),
            ("lab", {"gallery": "chain", "port": 0, "browser": False}),
            ("list", {"json": "-"}),
            ("sim", {"run": str(runs["hopper"]), "frozen": True, "agent": {"learning_rate": 0.1}}),
            *(("sim", tomllib.loads(scene.read_text())) for scene in SCENES),
            ("train", tomllib.loads((runs["hopper"] / "config.toml").read_text())),
        ]
        for name in TASKS:
            status, out, err = check("train", _written(folder / "task.toml", {"task": {"name": name}}))
            assert status == 0, err
            tables.append(("train", tomllib.loads(out)))
            tables.append(("train", {"task": {"name": name}, "agent": {"learning_rate": 0.1}, "steps": 100}))
        # `sweep` and `compare` read files of their own kind, which have tests of their own
        assert {command for command, _ in tables} == set(COMMANDS) - {"sweep", "compare"}
        yield tables, folder


def _written(path, table):
    path.write_text(tomli_w.dumps(table))
    return path


extremes = [0, -1, 1, 2, 3, 2000, 10**6, 2**31 - 1, 2**31, 2**32, 2**63, 10**30, -(10**30), 10**400]
extremes += [0.0, -0.0, 0.5, 1.0, -1.5, 1e-300, 1e30, 1e300, math.inf, -math.inf, math.nan]
words = ["", " ", "hopper", "chain", "walk", "none", "None", "\x00", "a\nb", "é", "x" * 5000, "../..", "/dev/null", "-"]
words += ["sgd", "never", "gaussians", "motoneurons", "mode", "wall", "fig-5.5", "spring", "../../nowhere/x.mp4"]
scalars = st.one_of(st.sampled_from(extremes), st.sampled_from(words), st.booleans(), st.integers(), st.floats())
spoilt = st.one_of(
    scalars,
    st.lists(scalars, max_size=3),
    st.dictionaries(st.sampled_from(["name", "low", "width", "body", "weights", "x y"]), scalars, max_size=2),
    st.sampled_from([{}, [], [[[[]]]], {"a": {"b": {"c": {}}}}, [{"name": "m", "group": "g"}]]),
)
keys = st.sampled_from(
    ["run", "task", "agent", "name", "steps", "policy", "learning_rate", "decay", "units", "extra_muscles", "Steps"]
)


def _places(table, where=()):
    for key, value in table.items():
        yield (*where, key)
        if isinstance(value, dict):
            yield from _places(value, (*where, key))


@st.composite
def mutated(draw, tables):
    """A command, and the content of a file for it that is spoilt in some places."""
    command, table = draw(st.sampled_from(tables))
    table = tomllib.loads(tomli_w.dumps(table))
    for _ in range(draw(st.integers(0, 3))):
        places = list(_places(table))
        *way, key = draw(st.sampled_from(places)) if places else ("steps",)
        inner = table
        for step in way:
            inner = inner[step]
        match draw(st.sampled_from(["change", "change", "drop", "rename", "typo", "add", "nest", "move"])):
            case "change":
                inner[key] = copy.deepcopy(draw(spoilt))
            case "drop":
                inner.pop(key, None)
            case "rename":
                inner[draw(keys)] = inner.pop(key, 0)
            case "typo":
                at = draw(st.integers(0, len(key)))
                inner[key[:at] + draw(st.sampled_from(["x", "-", " ", ".", "é", ""])) + key[at + 1 :]] = inner.pop(
                    key, 0
                )
            case "add":
                inner[draw(keys)] = copy.deepcopy(draw(spoilt))
            case "nest":
                inner[key] = {key: inner.get(key, 0)}
            case "move":
                table[key] = inner.pop(key, 0)
    text = tomli_w.dumps(table).replace("1" + "0" * 400, draw(st.sampled_from(["1" + "0" * 400, "9" * 5000, "0xffff"])))
    return command, _spoil(draw, text)


def _spoil(draw, text):
    content, lines = text.encode(), text.splitlines()
    match draw(st.sampled_from([*["whole"] * 12, "flip", "cut", "twice", "mark", "insert", "deep", "empty"])):
        case "flip" if content:
            at = draw(st.integers(0, len(content) - 1))
            content = content[:at] + bytes([draw(st.integers(0, 255))]) + content[at + 1 :]
        case "cut":
            content = content[: draw(st.integers(0, len(content)))]
        case "twice" if lines:
            at = draw(st.integers(0, len(lines) - 1))
            content = "\n".join([*lines[: at + 1], *lines[at:]]).encode()
        case "mark":
            content = b"\xef\xbb\xbf" + content.replace(b"\n", b"\r\n")
        case "insert":
            at = draw(st.integers(0, len(content)))
            content = content[:at] + draw(st.binary(max_size=4)) + content[at:]
        case "deep":
            depth = draw(st.sampled_from([50, 5000]))
            content = b"steps = " + b"[" * depth + b"]" * depth + b"\n" + content
        case "empty":
            content = b""
    return content


def _judge(command, path, folder):
    """The exit status, if all is as it should be."""
    before = set(folder.rglob("*"))
    status, out, err = check(command, path)
    assert "Traceback" not in err
    assert set(folder.rglob("*")) == before  # nothing is made
    if status == 0:
        assert err == ""
        again = folder / "effective.toml"
        again.write_text(out)
        try:
            assert check(command, again) == (0, out, "")  # what is printed is a file that says the same
        finally:
            again.unlink()
    else:
        assert status == 2
        assert out == ""
        assert err.count("\n") == 1, err
        assert len(err) < 1200  # all settings by name, where nothing is near
        assert err.startswith(f"motorgrad {command}: ")
        assert len(err) > len(f"motorgrad {command}: ") + 10
    return status


def _spoil_many(count, sound, monkeypatch):
    tables, folder = sound
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "200")
    path = folder / "spoilt.toml"
    for command, table in tables:
        _judge(command, _written(path, table), folder)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    seen = {0: 0, 2: 0}

    @settings(
        max_examples=count, deadline=PATIENCE, database=None, suppress_health_check=list(HealthCheck), derandomize=True
    )
    @given(mutated(tables))
    def judged(case):
        command, content = case
        path.write_bytes(content)
        seen[_judge(command, path, folder)] += 1

    judged()
    path.unlink()
    assert sum(seen.values()) >= count
    assert min(seen.values()) > count / 20  # some are in order after all
    assert (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - used) * 1024 < MEMORY


@pytest.mark.ci
@pytest.mark.parametrize("count", [100, pytest.param(10_000, marks=[pytest.mark.slow])])
def test_a_spoilt_file_gives_an_answer_or_is_refused_on_one_line(count, sound, monkeypatch):
    _spoil_many(count, sound, monkeypatch)


@pytest.mark.parametrize("command", COMMANDS)
@pytest.mark.parametrize("place", ["missing.toml", ".", "/dev/zero", "x" * 300, "file/in/file"])
def test_what_is_no_file_is_refused(command, place, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("file").write_text("")
    status, out, err = check(command, place)
    assert (status, out, err.count("\n")) == (2, "", 1)
    assert place in err


def _leaves(table, way=()):
    for key, value in table.items():
        if isinstance(value, dict):
            yield from _leaves(value, (*way, key))
        elif not isinstance(value, list) or not any(isinstance(each, dict | list) for each in value):
            yield (*way, key), value


def _line(table):
    """The words that say the same as the table of a training, as far as they can."""
    found = [table["task"]["name"]]
    for way, value in _leaves(table):
        flag = "--" + ".".join(way).replace("_", "-")
        if way[-1] in ("name", "kind") and len(way) == 2:
            continue
        if isinstance(value, bool):
            found.append(flag if value else f"--no-{flag[2:]}")
        else:
            found += [flag, *(map(str, value) if isinstance(value, list) else [str(value)])]
    return found


ODD_WORDS = [
    "",
    "-",
    "--",
    "---",
    "=",
    "--=",
    "--steps",
    "--steps=",
    "--seeds",
    "--agent",
    "--agent.",
    "--agent..decay",
]
ODD_WORDS += [
    "--agent.decay",
    "--agent.trace",
    "window",
    "none",
    "--task.x",
    "--no-steps",
    "--config",
    "--sweep",
    "a=b",
]
ODD_WORDS += ["decay=0.1,0.2", "-1", "1e400", "nan", "٣", "1,000", "é", "\x1b[0m", "x" * 3000, "--help", "--check"]


@st.composite
def mutated_lines(draw, lines):
    line = list(draw(st.sampled_from(lines)))
    for _ in range(draw(st.integers(0, 4))):
        at = draw(st.integers(0, len(line)))
        match draw(st.sampled_from(["drop", "twice", "insert", "change", "typo", "swap", "join"])):
            case "drop":
                del line[at : at + draw(st.integers(1, 3))]
            case "twice":
                line[at:at] = line[at : at + 2]
            case "insert":
                line.insert(at, draw(st.sampled_from(ODD_WORDS)))
            case "change" if at < len(line):
                line[at] = str(draw(scalars))
            case "typo" if at < len(line):
                letter = draw(st.integers(0, len(line[at])))
                line[at] = line[at][:letter] + draw(st.sampled_from(["x", "-", ".", "", "é"])) + line[at][letter + 1 :]
            case "swap" if at + 1 < len(line):
                line[at], line[at + 1] = line[at + 1], line[at]
            case "join" if at + 1 < len(line):
                line[at : at + 2] = [f"{line[at]}={line[at + 1]}"]
    return line


@pytest.mark.ci
@pytest.mark.parametrize("count", [100, pytest.param(10_000, marks=[pytest.mark.slow])])
def test_a_spoilt_command_line_gives_an_answer_or_is_refused_on_one_line(count, sound, monkeypatch):
    tables, folder = sound
    monkeypatch.chdir(folder)
    monkeypatch.setenv("COLUMNS", "200")
    lines = [_line(table) for command, table in tables if command == "train" and "name" in table.get("task", {})]
    seen = {0: 0, 2: 0}

    @settings(
        max_examples=count, deadline=PATIENCE, database=None, suppress_health_check=list(HealthCheck), derandomize=True
    )
    @given(mutated_lines(lines))
    def judged(line):
        before = set(folder.rglob("*"))
        status, out, err = run_command("train", *line, "--check")
        assert set(folder.rglob("*")) == before  # nothing is made
        assert "Traceback" not in err
        seen[status] += 1
        if status == 2:
            assert out == ""
            assert err.count("\n") == 1, err
            assert err.startswith("motorgrad train: ")

    judged()
    assert min(seen.values()) > count / 20
