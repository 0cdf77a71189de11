"""`train` and `load`: run directories, going on with a run, and what is refused before any work."""

import dataclasses
import json
import re
import shutil
import tomllib

import jax
import numpy as np
import optax
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from training_examples import NEVER, PLAIN, TASK_NAMES, assert_same, assert_same_run, checkpoints, columns

import motorgrad as mg
from motorgrad._progress import Progress
from motorgrad.tasks import TASKS
from motorgrad.training import RunDirectoryError, agent_for, clear_programs

FINITE = "three-state"


def small(task=FINITE, steps=60, seeds=(4, 1), out=None, agent=None, window=20, **options):
    task = TASKS[task]() if isinstance(task, str) else task
    options = {"checkpoint_every": NEVER, "progress": False, "threads": 1} | options
    return mg.train(task, agent, steps, list(seeds), out, window=window, **options)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A small run of each task, made once, when first asked for. Copy its directory before changing anything there."""
    runs = {}

    def of(name):
        if name not in runs:
            agent = PLAIN if name == "gymnasium" else None
            runs[name] = small(name, agent=agent, out=tmp_path_factory.mktemp(name))
        return runs[name]

    return of


@pytest.mark.representatives("hopper", "three-state")
@pytest.mark.parametrize("name", TASK_NAMES)
def test_a_run_directory_holds_all_there_is_to_know(name, made):
    run = made(name)
    path = run.path
    assert {p.name for p in path.iterdir() if p.name not in (".lock", ".signature")} == {
        "config.toml",
        "provenance.json",
        "metrics",
        "checkpoint",
        "figures",
    }
    assert {p.name for p in (path / "checkpoint").iterdir()} == {"initial.policies", "000000000060.state"}
    assert tomllib.loads((path / "config.toml").read_text()) == run.config
    assert run.config["run"] == {"steps": 60, "seeds": [4, 1], "window": 20}
    assert run.config["task"]["name"] == name
    told = json.loads((path / "provenance.json").read_text())
    assert told["seeds"] == [4, 1]
    (session,) = told["sessions"]
    assert {"motorgrad", "jax", "mujoco", "numpy", "python"} <= set(session["versions"])
    assert session["processor"]
    assert session["command"]


@pytest.mark.ci
@pytest.mark.representatives("hopper", "three-state")
@pytest.mark.parametrize("name", TASK_NAMES)
def test_the_metrics_have_a_row_for_every_window_and_seed(name, made):
    task = TASKS[name]()
    table = pa.concat_tables(pq.read_table(part) for part in sorted((made(name).path / "metrics").glob("*.parquet")))
    numbers = {"seed": pa.int32(), "decision": pa.int64(), "simulated_time": pa.float64(), "wall_time": pa.float64()}
    numbers["cpu_time"] = pa.float64()
    assert {name: table.schema.field(name).type for name in numbers} == numbers
    metrics = [column for report in task.metric_names for column in (report, f"{report}_count")]
    counts = ["diverged"] if isinstance(task, mg.tasks.HostTask) else []
    counts += ["episodes"] if task.has_episodes else []
    assert table.column_names == [*numbers, "reward", *sorted([*counts, *metrics, "baseline"]), "parameters"]
    np.testing.assert_array_equal(table["decision"], np.repeat([20, 40, 60], 2))
    np.testing.assert_array_equal(table["seed"], np.tile([4, 1], 3))
    np.testing.assert_allclose(table["simulated_time"], np.repeat([20, 40, 60], 2) * task.period)
    assert np.isfinite(table["reward"].to_numpy()).all()
    for clock in ("wall_time", "cpu_time"):
        assert (np.diff(table[clock].to_numpy(), prepend=0) >= 0).all()
    assert table["cpu_time"][-1].as_py() > 0


@pytest.mark.ci
@pytest.mark.representatives("hopper", "three-state")
@pytest.mark.parametrize("name", TASK_NAMES)
def test_load_gives_the_run_back(name, made):
    run = made(name)
    again = mg.load(run.path)
    assert_same_run(again, run)
    assert again.metrics.schema == run.metrics.schema
    np.testing.assert_array_equal(again.metrics["wall_time"], run.metrics["wall_time"])
    assert again.task == run.task == TASKS[name]()
    assert again.seeds == [4, 1]
    one = again.policy(1)
    assert_same(one, jax.tree.map(lambda leaf: leaf[1], run.policies))
    assert np.isfinite(one.entropy(np.ones(one.inputs, np.float32)))


def test_the_last_parameters_recorded_are_the_policies(made):
    run = made(FINITE)
    np.testing.assert_array_equal(columns(run.metrics)["parameters"][-2:], run.policies.weights.reshape(2, -1))


@pytest.mark.parametrize("name", [FINITE, "hopper"])
def test_a_run_in_memory_is_the_same_run(name, made):
    kept, stored = small(name), made(name)
    assert kept.path is None
    assert kept.complete
    assert kept.config == stored.config
    assert_same(columns(kept.metrics), columns(stored.metrics))
    assert_same(kept.policies, stored.policies)
    assert_same(kept.initial, stored.initial)


def test_the_same_seeds_twice_give_the_same_run(made, tmp_path):
    assert_same_run(small("hopper", out=tmp_path), made("hopper"))


@pytest.mark.parametrize("every", [0.0, NEVER])
def test_checkpoints_change_nothing(every, made, tmp_path):
    assert_same_run(small(out=tmp_path, checkpoint_every=every), made(FINITE))


@pytest.mark.ci
def test_a_task_by_name_learns_with_its_own_learner():
    run = mg.train(FINITE, steps=10, progress=False)
    assert run.seeds == [0]
    assert run.config["agent"]["estimator"]["trace"]["decay"] == 0.8


def test_a_finished_run_is_given_back(made, tmp_path):
    first = made("hopper")
    shutil.copytree(first.path, tmp_path, dirs_exist_ok=True)
    files = {path: path.read_bytes() for path in tmp_path.rglob("*.parquet")}
    again = small("hopper", out=tmp_path)
    assert_same_run(again, first)
    np.testing.assert_array_equal(again.metrics["wall_time"], first.metrics["wall_time"])
    assert {path: path.read_bytes() for path in tmp_path.rglob("*.parquet")} == files
    fewer = small("hopper", steps=20, out=tmp_path)
    assert fewer.decision == 60
    assert fewer.config == first.config
    assert len(json.loads((tmp_path / "provenance.json").read_text())["sessions"]) == 3


@pytest.mark.representatives("three-state")
@pytest.mark.parametrize("name", [FINITE, "hopper"])
def test_more_steps_continue_a_run_as_if_it_had_been_made_in_one_go(name, tmp_path):
    small(name, steps=50, out=tmp_path / "parts")
    small(name, steps=90, out=tmp_path / "parts", window=None)
    parts = small(name, steps=200, out=tmp_path / "parts")
    whole = small(name, steps=200, out=tmp_path / "whole")
    assert columns(parts.metrics)["decision"][::2].tolist() == [*range(20, 201, 20)]
    assert_same_run(mg.load(parts.path), mg.load(whole.path))
    assert parts.config == whole.config


def test_an_unfinished_window_has_a_record_that_goes_with_more_steps(tmp_path):
    for where in (None, tmp_path):
        ends = columns(small(steps=50, out=where).metrics)["decision"][::2].tolist()
        assert ends == [20, 40, 50]
    again = small(steps=50, out=tmp_path)  # given back
    assert_same(columns(again.metrics), columns(small(steps=50).metrics))


LEARNERS = {
    "a batch": {"estimator": "gpomdp", "update_every": 32},
    "a window": {"trace": {"kind": "window", "length": 5}},
    "a lag": {"trace": {"kind": "lagged-gaussian", "lag": 2.0}},
    "a discount": {"discount": 0.99, "trace": "episodic", "update_every": "episode"},
    "a fixed step": {"baseline": "fixed-step"},
    "adam": {"optimizer": "adam"},
}


@pytest.mark.ci  # complete states are stored whatever they are: test_training_growth.py
@pytest.mark.parametrize("kind", LEARNERS)
def test_every_kind_of_learner_goes_on_exactly(kind, tmp_path):
    task = mg.make("chain", length=3, time_limit=9)
    for name, legs in (("parts", (75, 150)), ("whole", (150,))):
        for steps in legs:
            small(task, steps, out=tmp_path / name, agent=LEARNERS[kind], window=25)
    assert_same_run(mg.load(tmp_path / "parts"), mg.load(tmp_path / "whole"))
    assert not np.array_equal(mg.load(tmp_path / "whole").policies.weights, np.zeros((2, 2, 3)))


CHANGED = {
    "run.window was 20 and is now 10": {"window": 10},
    r"run.seeds was \[4, 1\] and is now \[1, 4\]": {"seeds": (1, 4)},
    "task.time_limit was None and is now 5": {"task": mg.make(FINITE, time_limit=5)},
    "task.name was 'three-state' and is now 'chain'": {"task": "chain"},
    r"agent.estimator.trace.decay was 0.8 and is now 0.5": {"changes": {"decay": 0.5}},
    r"agent.optimizer.learning_rate was 0.01 and is now 0.1": {"changes": {"learning_rate": 0.1}},
    r"agent.estimator.baseline was {'kind': 'mean'} and is now 'none'": {"changes": {"baseline": "none"}},
    r"agent.optimizer.kind was 'sgd' and is now 'adam'": {"changes": {"optimizer": "adam"}},
}


@pytest.mark.parametrize("named", CHANGED)
def test_another_configuration_is_refused_by_its_first_difference(named, made, tmp_path):
    run = made(FINITE)
    shutil.copytree(run.path, tmp_path, dirs_exist_ok=True)
    options = dict(CHANGED[named])
    task = options.pop("task", mg.make(FINITE))
    task = mg.make(task) if isinstance(task, str) else task
    agent = agent_for(task, options.pop("changes", {}))
    with pytest.raises(RunDirectoryError, match=rf"holds a run of another configuration: {named};"):
        small(task, out=tmp_path, agent=agent, **options)
    assert_same_run(mg.load(tmp_path), run)


def test_more_steps_with_another_learner_are_refused_with_the_way_to_go_on(made, tmp_path):
    run = made(FINITE)
    shutil.copytree(run.path, tmp_path, dirs_exist_ok=True)
    steps = run.config["run"]["steps"]
    with pytest.raises(RunDirectoryError, match=r"learning_rate was 0\.01 and is now") as refused:
        small(FINITE, steps + 20, out=tmp_path, agent=agent_for(mg.make(FINITE), learning_rate=0.1))
    assert f"mg.resume({str(tmp_path)!r}, {steps + 20})" in str(refused.value)
    assert mg.resume(tmp_path, steps + 20, progress=False).decision == steps + 20


def chained(rate):
    return optax.chain(optax.clip(1.0), optax.scale(-rate))


def test_another_beginning_is_refused(tmp_path):
    # nothing in words tells these learners apart: optax keeps its numbers to itself, a policy has too many
    task, rule = mg.make(FINITE), chained(0.01)
    start = mg.policies.softmax(task)
    other = jax.tree.map(lambda leaf: leaf + 0.5, start)
    small(out=tmp_path, agent=mg.Agent(start, optimizer=rule))
    agents = {"initial": mg.Agent(other, optimizer=rule), r"optimizer\.steps": mg.Agent(start, optimizer=chained(0.02))}
    for named, agent in agents.items():
        with pytest.raises(RunDirectoryError, match=rf"agent\.{named} was .* and is now "):
            small(out=tmp_path, agent=agent)
    assert small(out=tmp_path, agent=mg.Agent(start, optimizer=rule)).complete


def test_a_folder_with_other_files_is_refused_and_left_as_it_was(tmp_path):
    (tmp_path / "thesis.md").write_text("years of work")
    with pytest.raises(RunDirectoryError, match=r"holds other files \(thesis.md\) and no config.toml: not a run"):
        small(out=tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.md"]


def test_a_file_in_the_place_of_the_directory_is_refused(tmp_path):
    (tmp_path / "run").write_text("")
    with pytest.raises(RunDirectoryError, match="run is a file, not a run directory"):
        small(out=tmp_path / "run")


def test_an_empty_folder_becomes_a_run(tmp_path):
    (tmp_path / "run").mkdir()
    assert small(out=tmp_path / "run").complete


@pytest.mark.parametrize("made", [False, True])
def test_what_is_not_a_run_is_not_loaded(made, tmp_path):
    if made:
        (tmp_path / "run").mkdir()
    with pytest.raises(RunDirectoryError, match=r"run is not a run directory: it has no config\.toml"):
        mg.load(tmp_path / "run")


IMPOSSIBLE = [
    *(("steps", value) for value in (0, -1, 1.5, True, "many", 2**32)),
    *(("seeds", value) for value in (0, -2, [], [1, 1], [-1], [2**31], [0.5], [True], ["1"], True, 1.5)),
    *(("window", value) for value in (0, -1, 2.5)),
    *(("checkpoint_every", value) for value in (-1, float("nan"))),
    *(("threads", value) for value in (-1, 0.5)),
]


@pytest.mark.parametrize(("name", "value"), IMPOSSIBLE, ids=[f"{name}={value}" for name, value in IMPOSSIBLE])
def test_impossible_arguments_are_refused_by_name_before_any_work(name, value, tmp_path):
    options = {"steps": 20, "seeds": 1, "out": tmp_path / "run", "progress": False} | {name: value}
    with pytest.raises(ValueError, match=rf"^{name} = "):
        mg.train(FINITE, **options)
    assert not (tmp_path / "run").exists()


def test_an_unknown_task_is_refused_with_the_nearest():
    with pytest.raises(ValueError, match="unknown task 'hoper': did you mean 'hopper'"):
        mg.train("hoper")


def test_a_run_refuses_seeds_and_quantities_that_it_does_not_have(made):
    run = made(FINITE)
    with pytest.raises(ValueError, match=r"seed = 7: must be one of the run's seeds, \[4, 1\]"):
        run.policy(7)
    with pytest.raises(ValueError, match="unknown quantity 'rewards': did you mean 'reward'"):
        run.curve("rewards")


def test_policies_act_in_a_changed_task_of_the_same_observations_and_actions(made):
    run = made("hopper")
    short = dataclasses.replace(run.task, time_limit=0.2)
    assert run.with_task(short).task == short
    assert run.with_task(short).with_task(run.task).task == run.task
    with pytest.raises(ValueError, match="task = 'three-state': must be a task of the kind 'hopper'"):
        run.with_task(TASKS[FINITE]())
    with pytest.raises(ValueError, match=r"task\.observation_names = "):
        run.with_task(dataclasses.replace(run.task, observe_contact=False))


def test_a_curve_has_the_seeds_in_rows(made):
    run = made(FINITE)
    decision, values = run.curve("reward")
    np.testing.assert_array_equal(decision, [20, 40, 60])
    np.testing.assert_array_equal(values[0], run.metrics.filter(pa.compute.field("seed") == 4)["reward"])
    assert values.shape == (2, 3)


def test_parameters_over_time_are_arrays(made):
    run = made(FINITE)
    history = run.policies_at()
    for stored, learned in zip(jax.tree.leaves(history), jax.tree.leaves(run.policies), strict=True):
        assert stored.shape == (3, *learned.shape)
        np.testing.assert_array_equal(stored[-1], learned)
    for one, all_ in zip(jax.tree.leaves(run.policies_at([-1, 0], seed=1)), jax.tree.leaves(history), strict=True):
        np.testing.assert_array_equal(one, all_[::-2, 1])
    with pytest.raises(ValueError, match=r"records = \[3\]: must be among the 3 records"):
        run.policies_at([3])
    with pytest.raises(ValueError, match=r"seed = 7: must be one of the run's seeds, \[4, 1\]"):
        run.policies_at(seed=7)


def with_rewards(run, rows):
    """The run with these rewards, one row per seed."""
    column = pa.array(np.array(rows, np.float32).T.ravel())
    return dataclasses.replace(
        run, metrics=run.metrics.set_column(run.metrics.column_names.index("reward"), "reward", column)
    )


def test_the_time_to_a_bar_is_that_of_the_first_record_beyond_it(made):
    run = with_rewards(made(FINITE), [[0.1, 0.5, 0.9], [0.25, 0.25, 0.25]])
    np.testing.assert_array_equal(run.first_time(above=0.4), [40, np.nan])
    np.testing.assert_array_equal(run.first_time("reward", below=0.15, never=60), [20, 60])
    np.testing.assert_array_equal(run.first_time(above=0.25, x="decisions"), [40, np.nan])  # to pass is not to reach
    assert (run.first_time(above=-1.0, x="wall") > 0).all()
    for bars in ({}, {"above": 0.0, "below": 1.0}):
        with pytest.raises(ValueError, match=r"above, below = .* one of the two"):
            run.first_time(**bars)


def test_a_mean_over_few_records_counts_for_no_bar(made):
    run = with_rewards(made(FINITE), [[0.9, 0.1, 0.2], [0.1, 0.9, 0.9]])
    time, values = run.curve(smooth=40)
    np.testing.assert_array_equal(time, [20, 40, 60])
    np.testing.assert_allclose(values, [[0.9, 0.5, 0.15], [0.1, 0.5, 0.9]], rtol=1e-6)
    np.testing.assert_array_equal(run.first_time(above=0.8, smooth=40), [np.nan, 60])
    np.testing.assert_array_equal(run.curve(smooth=1)[1], values)  # two records at least
    with pytest.raises(ValueError, match="has no simulated time"):
        run.curve(x="simulated")


def test_the_end_of_training_is_a_share_of_its_records(made):
    run = with_rewards(made(FINITE), [[0.1, 0.5, 0.9], [0.2, 0.4, 0.2]])
    np.testing.assert_allclose(run.final(), [0.9, 0.2], rtol=1e-6)
    np.testing.assert_allclose(run.final(share=0.7), [0.7, 0.3], rtol=1e-6)
    with pytest.raises(ValueError, match="share = 0: must be above 0, at most 1"):
        run.final(share=0)


@pytest.mark.ci
@pytest.mark.representatives(".svg")
@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_learning_curve_is_drawn(suffix, made, tmp_path):
    path = tmp_path / "figures" / f"curve{suffix}"
    made("hopper").plot("apex", path)
    assert path.stat().st_size > 1000


def test_progress_without_a_terminal_is_a_line_now_and_then(capsys):
    mg.train(FINITE, steps=2000, seeds=2, progress=True)
    said = capsys.readouterr().err.replace("\n", " ")
    assert "2,000/2,000 decisions" in said
    assert "2 seeds" in said
    mg.train(FINITE, steps=10, progress=False)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("updates", "said", "unsaid"),
    [
        ([], "0:00 compiling", "left"),
        ([(20.0, 1, False)], "compiling · reward 1", "left"),
        ([(20.0, 1, False), (0.2, 2, True)], "compiling · reward 1", "left"),  # too short to tell
        ([(20.0, 1, False), (1.0, 101, True)], "0:09 left reward 1", "compiling"),
        ([(20.0, 1, False), (1.0, 101, True), (30.0, 102, False)], "0:09 left reward 1", "compiling"),
        ([(20.0, 1, False), (1.0, 101, True), (30.0, 1000, True)], "100% 0:00", "left"),
    ],
)
def test_a_bar_says_that_it_compiles_and_leaves_that_out_of_the_time_left(updates, said, unsaid, monkeypatch, capsys):
    monkeypatch.setenv("TTY_COMPATIBLE", "1")  # a terminal for rich
    now = 0.0
    monkeypatch.setattr("motorgrad._progress.perf_counter", lambda: now)
    with Progress("hop", "decisions", 1000, 0, True, at_first="compiling") as bar:
        for seconds, done, usual in updates:
            now += seconds
            bar.update(done, "reward 1", usual)
    last = re.sub(r"\x1b\[[^A-Za-z]*[A-Za-z]", "", capsys.readouterr().err).strip().splitlines()[-1]
    assert said in " ".join(last.split())
    assert unsaid not in last


def test_the_bar_is_there_while_programs_are_made(monkeypatch, capsys):
    clear_programs()
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    mg.train(FINITE, steps=2000)
    said = capsys.readouterr().err
    assert said.index("compiling") < said.index("reward")


def test_at_most_two_checkpoints_are_kept(tmp_path):
    for steps in (20, 40, 60):
        small(steps=steps, out=tmp_path)
    assert [path.stem for path in checkpoints(tmp_path)] == ["000000000040", "000000000060"]
