"""Sweeps: several settings of a learner's numbers in one compiled call; and compiled programs that engines share."""

import json
import tomllib

import jax
import numpy as np
import pytest
from jax import monitoring
from training_examples import assert_differ, assert_same, assert_same_run, columns

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.policies import INITIAL
from motorgrad.schema import with_number
from motorgrad.training import RunDirectoryError, agent_for, clear_programs, evaluate, load, stepper_for
from motorgrad.training.engines import _programs

FINITE = "three-state"
DECAY, RATE = "estimator.trace.decay", "optimizer.learning_rate"
DECAYS, RATES = [0.5, 0.8], [0.01, 0.1]
SEEDS = [4, 1]


def go(sweep=None, agent=None, steps=60, seeds=SEEDS, out=None, task=FINITE, **options):
    options = {"window": 20, "threads": 1, "progress": False} | options
    return mg.train(task, agent, steps, seeds, out, sweep=sweep, **options)


def lanes(run, index):
    """The policies of one setting of a sweep."""
    count = len(run.seeds)
    return jax.tree.map(lambda leaf: leaf[index * count : (index + 1) * count], run.policies)


@pytest.fixture
def compiled():
    """The events of compiling since the fixture was asked for."""
    found = []

    def note(name, _duration, **_):
        if name == "/jax/core/compile/backend_compile_duration":
            found.append(name)

    monitoring.register_event_duration_secs_listener(note)
    yield found
    monitoring.unregister_event_duration_listener(note)


# ---- which settings


def test_a_mapping_of_lists_is_a_product_whose_last_path_changes_fastest():
    run = go({"decay": DECAYS, "learning_rate": RATES})
    assert run.settings == [{DECAY: decay, RATE: rate} for decay in DECAYS for rate in RATES]
    assert run.lanes == 4 * len(SEEDS)
    np.testing.assert_array_equal(run.metrics["setting"].to_numpy()[: run.lanes], np.repeat(range(4), 2))
    np.testing.assert_array_equal(run.metrics["seed"].to_numpy()[: run.lanes], np.tile(SEEDS, 4))


def test_a_list_of_mappings_is_run_as_it_stands():
    numbers = [(0.5, 0.1), (0.8, 0.01), (0.7, 0.2), (0.1, 0.3)]  # as many as in the product, for the same program
    settings = [{DECAY: decay, RATE: rate} for decay, rate in numbers]
    run = go([{"decay": 0.5, "learning_rate": 0.1}, *settings[1:]])
    assert run.settings == settings
    assert len(run.split()) == 4


REFUSED = [
    ({"decy": [0.5]}, "unknown number in the sweep 'decy': did you mean"),
    ({"estimator.trace.decy": [0.5]}, "unknown number in the sweep 'estimator.trace.decy'"),
    ({"update_every": [1, 2]}, "'update_every' is part of the structure, not a number"),
    ({"estimator.trace": [0.5]}, "'estimator.trace' is part of the structure"),
    ({"discount": [0.9]}, "'discount' is absent in this agent: give it a value first"),
    ({"policy.width": [0.1]}, "unknown number in the sweep 'policy.width'"),
    ({"decay": 0.5}, r"sweep\['decay'\] = 0.5: must be a list of numbers"),
    ({"decay": []}, r"sweep\['decay'\] = \[\]: must be a list of numbers"),
    ({"decay": ["much"]}, r"sweep\['estimator.trace.decay'\] = 'much': must be a number"),
    ({"decay": [0.5, 1.5]}, r"estimator.trace.decay = 1.5: must be in \[0, 1\]"),
    ({"decay": [0.5, float("nan")]}, "estimator.trace.decay = nan"),
    ({"decay": [0.5, 1.0]}, "needs episodes"),
    ({"decay": [0.5, 0.5]}, "without a setting that occurs twice"),
    ({}, "sweep = {}: must be paths and lists of numbers"),
    ([], r"sweep = \[\]: must be paths and lists of numbers"),
    (["decay"], "must be paths and lists of numbers"),
    ([{DECAY: 0.5}, {RATE: 0.5}], "settings of the same numbers"),
]


@pytest.mark.parametrize(("sweep", "named"), REFUSED, ids=[str(sweep) for sweep, _ in REFUSED])
def test_what_cannot_be_swept_is_refused_by_name_before_any_work(sweep, named, tmp_path):
    with pytest.raises(ValueError, match=named):
        go(sweep, out=tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_more_lanes_than_a_run_may_have_are_refused():
    with pytest.raises(ValueError, match="must be at most 1000000 in all"):
        go({"decay": np.linspace(0, 0.9, 101)}, seeds=10_000)


def test_the_last_word_of_a_path_is_answered_with_the_path():
    with pytest.raises(ValueError, match=r"'rate': did you mean estimator.baseline.rate\?"):
        go({"rate": [0.5]}, {"baseline": "fixed-step"})


def test_event_files_of_a_sweep_are_refused(tmp_path):
    with pytest.raises(ValueError, match="tensorboard = True: must be False for a sweep"):
        go({"decay": DECAYS}, out=tmp_path / "run", tensorboard=True)


# ---- what is learned


def test_a_setting_of_a_sweep_is_the_run_with_that_setting_bit_for_bit():
    # Two settings of two seeds are as many lanes as four seeds, so that both are compiled to the same operations.
    swept = go({"decay": DECAYS}, steps=300)
    for index, decay in enumerate(DECAYS):
        others = [7, 9]
        alone = go(agent={"decay": decay}, steps=300, seeds=[*SEEDS, *others] if index == 0 else [*others, *SEEDS])
        own = slice(0, 2) if index == 0 else slice(2, 4)
        assert_same(lanes(swept, index), jax.tree.map(lambda leaf, own=own: leaf[own], alone.policies))
    assert_differ(lanes(swept, 0), lanes(swept, 1))


SWEEPS = {
    "a world": (FINITE, {}, {"decay": DECAYS, "learning_rate": RATES}, 200),
    "a body": ("hopper", {}, {"learning_rate": [1e-4, 1e-3]}, 40),
    "a sparse agent": (
        mg.make("particle", units=64),
        {"kind": "sparse", "policy.width": 0.08, "learning_rate": 1e-3},
        {"decay": DECAYS},
        200,
    ),
    "a critic": (
        FINITE,
        {"baseline": {"kind": "critic", "features": {}, "fit": "td", "discount": 0.7}, "update_every": 10},
        {"estimator.baseline.discount": [0.5, 0.9]},
        100,
    ),
    "the natural gradient": (FINITE, {"metric": "fisher"}, {"damping": [0.1, 1.0]}, 100),
    "annealing": (
        FINITE,
        {"entropy": {"kind": "annealed", "start": 0.1, "steps": 50}},
        {"estimator.entropy.start": [0.1, 0.5]},
        100,
    ),
}


@pytest.mark.ci  # bit for bit, above
@pytest.mark.parametrize("kind", SWEEPS)
def test_every_setting_of_a_sweep_learns_as_it_does_alone(kind):
    task, agent, sweep, steps = SWEEPS[kind]
    run = go(sweep, agent, steps, task=task)
    for index, setting in enumerate(run.settings):
        learner = agent_for(task, agent)
        for path, value in setting.items():
            learner = with_number(learner, path, value)
        alone = go(None, learner, steps, task=task)
        # another number of lanes may round differently
        for mine, own in zip(jax.tree.leaves(lanes(run, index)), jax.tree.leaves(alone.policies), strict=True):
            np.testing.assert_allclose(mine, own, rtol=1e-4, atol=1e-6)
        part = run.split()[index]
        assert part.config == alone.config
        np.testing.assert_allclose(part.curve()[1], alone.curve()[1], rtol=1e-5, atol=1e-5)
    assert_differ(lanes(run, 0), lanes(run, 1))


def test_a_seed_has_the_same_random_numbers_under_every_setting():
    # Without learning, all settings of a seed live the same life.
    run = go({"decay": DECAYS}, {"learning_rate": 0.0}, 200)
    assert_same(lanes(run, 0), lanes(run, 1))
    first, second = (part.curve()[1] for part in run.split())
    np.testing.assert_array_equal(first, second)
    assert_differ(first[0], first[1])


def test_seeds_begin_from_their_own_policies_under_every_setting():
    first = go()
    run = go({"decay": DECAYS}, initial=first.policies)
    for part in run.split():
        assert_same(part.initial, first.policies)
    assert run.config["run"]["initial"] == go(initial=first.policies).config["run"]["initial"]


def test_a_sweep_from_given_policies_is_resumed_from_its_directory_alone(tmp_path):
    first = go()
    whole = go({"decay": DECAYS}, initial=first.policies, steps=80)
    go({"decay": DECAYS}, initial=first.policies, steps=60, out=tmp_path)
    assert_same(mg.training.given_initial(tmp_path), first.policies)
    assert_same(mg.resume(tmp_path, 80, progress=False).policies, whole.policies)


# ---- run directories


@pytest.mark.parametrize("name", [FINITE, pytest.param("hopper", marks=pytest.mark.slow)])
def test_a_sweep_is_resumed_bit_for_bit(name, tmp_path):
    sweep = {"learning_rate": RATES}
    whole = go(sweep, steps=120, out=tmp_path / "whole", task=name)
    go(sweep, steps=50, out=tmp_path / "parts", task=name)
    mg.resume(tmp_path / "parts", 90, progress=False)
    go(sweep, steps=120, out=tmp_path / "parts", task=name)
    assert_same_run(load(tmp_path / "parts"), load(whole.path))
    assert_same(columns(load(whole.path).metrics), columns(go(sweep, steps=120, task=name).metrics))


def test_another_sweep_is_refused(tmp_path):
    go({"decay": DECAYS}, out=tmp_path)
    for sweep in (None, {"decay": [0.5, 0.9]}, {"learning_rate": RATES}):
        with pytest.raises(RunDirectoryError, match="another configuration: sweep was"):
            go(sweep, out=tmp_path)


def test_a_sweep_is_loaded_split_judged_and_plotted(tmp_path):
    go({"decay": DECAYS}, out=tmp_path / "run")
    run = load(tmp_path / "run")
    assert tomllib.loads((run.path / "config.toml").read_text())["sweep"] == run.settings
    assert repr(run).startswith("Run(three-state, 2 settings of 2 seeds, 60 of 60 decisions")
    decision, values = run.curve()
    assert values.shape == (4, len(decision))
    wall, smooth = run.curve(x="wall", smooth=1e9)
    assert (wall.shape, smooth.shape) == (decision.shape, values.shape)
    for stored, learned in zip(jax.tree.leaves(run.policies_at([-1])), jax.tree.leaves(run.policies), strict=True):
        np.testing.assert_array_equal(stored[0], learned)
    with pytest.raises(ValueError, match=r"seed = 1: must be none for a sweep"):
        run.policies_at(seed=1)
    for index, part in enumerate(run.split()):
        assert part.settings == []
        assert part.path is None
        assert part.config["agent"]["estimator"]["trace"]["decay"] == DECAYS[index]
        np.testing.assert_array_equal(part.curve()[1], values[2 * index : 2 * index + 2])
        assert_same(part.policies, lanes(run, index))
        assert_same(part.policy(1), jax.tree.map(lambda leaf, at=2 * index + 1: leaf[at], run.policies))
        assert len(evaluate(part, 30).reward) == 2
    with pytest.raises(ValueError, match=r"of a run of one setting: run\.split\(\)"):
        run.policy(1)
    judged = evaluate(run, 30)
    assert judged.reward.shape == (4,)
    assert judged.records["setting"].to_pylist() == [0, 0, 1, 1]
    # the same seed acts on the same random numbers
    np.testing.assert_allclose(judged.reward[:2], evaluate(run.split()[0], 30).reward, rtol=1e-6)
    figure = run.plot()
    assert [curve.label for curve in figure.curves] == ["decay 0.5", "decay 0.8"]
    assert figure.saved == run.path / "figures" / "reward.png"


def test_a_run_without_a_sweep_splits_into_itself():
    run = go()
    assert run.split() == [run]
    assert run.settings == []
    assert "setting" not in run.metrics.column_names


# ---- the command line


def test_the_command_line_sweeps(tmp_path, capsys):
    out = str(tmp_path / "run")
    command = ["train", FINITE, "--steps", "60", "--window", "20", "--seeds", "4", "1", "--out", out]
    command += ["--json", str(tmp_path / "run.json")]
    assert main([*command, "--sweep", "decay=0.5,0.8", "learning-rate=1e-2,1e-1"]) == 0
    said = capsys.readouterr().out
    assert "decay = 0.8, learning_rate = 0.1:\n" in said
    assert said.count("over 2 seeds") == 4
    run = load(tmp_path / "run")
    assert_same(columns(run.metrics), columns(go({"decay": DECAYS, "learning_rate": RATES}).metrics))
    found = json.loads((tmp_path / "run.json").read_text())["settings"]
    assert [each["setting"] for each in found] == run.settings
    last = run.curve()[1][:, -1].reshape(4, 2)
    np.testing.assert_allclose([each["reward"]["per_seed"] for each in found], last, rtol=1e-6)
    assert main(["train", "--resume", str(tmp_path / "run"), "--steps", "80"]) == 0
    assert load(tmp_path / "run").decision == 80
    assert main(["train", "--config", str(tmp_path / "run" / "config.toml"), "--out", str(tmp_path / "again")]) == 0
    assert load(tmp_path / "again").settings == run.settings


@pytest.mark.ci
@pytest.mark.representatives("product")  # a list is read from config.toml, above
@pytest.mark.parametrize(
    "text",
    ["[sweep]\ndecay = [0.5, 0.8]\n", "[[sweep]]\ndecay = 0.5\n[[sweep]]\ndecay = 0.8\n"],
    ids=["product", "list"],
)
def test_a_file_sweeps(text, tmp_path, capsys):
    (tmp_path / "a.toml").write_text(f'steps = 20\nseeds = 2\n{text}[task]\nname = "{FINITE}"\n')
    out = tmp_path / "run"
    assert main(["train", "--config", str(tmp_path / "a.toml"), "--out", str(out), "--agent.learning-rate", "0.1"]) == 0
    assert load(out).settings == [{DECAY: 0.5}, {DECAY: 0.8}]


@pytest.mark.parametrize(
    ("word", "named"),
    [
        ("decay", "sweep = 'decay': must be a name and numbers"),
        ("decay=", "sweep = 'decay='"),
        ("decay=0.5,much", "sweep = 'decay=0.5,much'"),
        # as REFUSED
        pytest.param("decy=0.5", "unknown number in the sweep 'decy'", marks=pytest.mark.ci),
        pytest.param("update_every=1,2", "part of the structure", marks=pytest.mark.ci),
    ],
)
def test_a_sweep_that_cannot_be_is_refused_on_one_line(word, named, capsys):
    assert main(["train", FINITE, "--sweep", word, "--check"]) == 2
    said = capsys.readouterr().err
    assert named in said
    assert said.count("\n") == 1


# ---- shared programs


def test_other_numbers_compile_nothing(compiled):
    go({"decay": DECAYS}, {"learning_rate": 0.01})
    compiled.clear()
    go({"decay": [0.3, 0.9]}, {"learning_rate": 0.2})
    go(agent={"decay": 0.4}, seeds=4)  # as many lanes
    assert compiled == []
    go(agent={"decay": 0.4}, seeds=5)
    assert compiled


@pytest.mark.ci
def test_other_numbers_compile_nothing_on_a_body(compiled):
    go(task="hopper", steps=4, window=2)
    compiled.clear()
    go(task="hopper", steps=4, window=2, agent={"decay": 0.5, "learning_rate": 1e-3})
    assert compiled == []


def test_programs_are_shared_by_the_same_task_structure_and_mode_alone():
    clear_programs()
    task = mg.make("chain", time_limit=9)

    def program(task=task, mode="learn", **changes):
        return stepper_for(task, agent_for(task, changes), [0], mode).program

    own = program()
    assert program() is own
    assert program(mg.make("chain", time_limit=9), decay=0.1, learning_rate=0.5) is own
    assert program(mode="sample") is not own
    assert program(mg.make("chain", time_limit=8)) is not own
    for changes in (
        {"baseline": None},
        {"discount": 0.9},
        {"update_every": 2},
        {"optimizer": "adam"},
        {"trace": "window"},
    ):
        assert program(**changes) is not own
    assert program(learning_rate={"weights": 0.1}) is not own
    with jax.enable_x64(True):
        wide = program()
    assert wide is not own
    assert program() is own


def test_programs_used_longest_ago_are_dropped(monkeypatch):
    clear_programs()
    monkeypatch.setattr(_programs, "MAX_KEPT_PROGRAMS", 2)
    tasks = [mg.make("chain", length=length) for length in (3, 4, 5)]
    first, second, third = (stepper_for(task, agent_for(task), [0]).program for task in tasks)
    assert stepper_for(tasks[2], agent_for(tasks[2]), [0]).program is third
    assert stepper_for(tasks[1], agent_for(tasks[1]), [0]).program is second
    assert stepper_for(tasks[0], agent_for(tasks[0]), [0]).program is not first


# ---- numbers of a running learner


@pytest.mark.ci
@pytest.mark.representatives(f"{DECAY}-chain", f"{RATE}-hopper")
@pytest.mark.parametrize("name", ["chain", "hopper"])
@pytest.mark.parametrize("path", [DECAY, RATE])
def test_a_number_changes_while_a_learner_runs(name, path, compiled):
    task = mg.make(name)
    agent = agent_for(task)
    changed, plain = (stepper_for(task, agent, [3, 0], threads=1) for _ in range(2))
    other = stepper_for(task, agent_for(task, {path: 0.25}), [3, 0], threads=1)
    for stepper in (changed, plain):
        stepper.advance(30)
    other.advance(1)
    changed.set_number(path, 0.5)  # what puts it in place may be compiled once
    before = changed.state
    numbers = other.state["cycle"].numbers
    compiled.clear()
    changed.set_number(path, 0.25)
    assert compiled == []
    changed.advance(40)
    plain.advance(40)
    # an engine made with the other number goes on from the state in the same way
    other.restore({**before, "cycle": before["cycle"]._replace(numbers=numbers)})
    other.advance(40)
    assert_same(changed.state, other.state)
    assert_differ(changed.policies(), plain.policies())
    assert changed.agent == agent_for(task, {path: 0.25})


def test_a_number_that_cannot_be_is_refused_and_nothing_changes():
    task = mg.make("chain")
    stepper = stepper_for(task, agent_for(task), [0])
    before = stepper.state
    for path, value, named in (
        ("decay", 0.5, "unknown number 'decay'"),
        (DECAY, 1.5, r"estimator.trace.decay = 1.5: must be in \[0, 1\]"),
        (DECAY, 1.0, "needs episodes"),
        ("estimator.update_every", 3, "unknown number 'estimator.update_every'"),
    ):
        with pytest.raises(ValueError, match=named):
            stepper.set_number(path, value)
    assert_same(stepper.state, before)


# ---- a task's own learner, changed


def test_changing_one_of_a_tasks_settings_keeps_the_others():
    own, changed = (agent_for("particle", changes) for changes in ({}, {"policy.p_max": 0.5}))
    assert own.policy == INITIAL["tiles"](copies=2).bound(own.policy.task)
    assert (changed.policy.copies, changed.policy.p_max) == (2, 0.5)
    assert changed.optimizer == own.optimizer
    whole = agent_for("particle", policy={"p_max": 0.5})
    assert whole == changed
    assert repr(agent_for("particle", policy="gaussians").policy) == "InitialGaussians()"


@pytest.mark.ci
def test_the_command_line_says_in_what_a_learner_differs_from_the_tasks_own(tmp_path, capsys):
    command = ["train", "particle", "--task.units", "16", "--steps", "4", "--out", str(tmp_path / "run")]
    assert main([*command, "--agent.policy.p-max", "0.5"]) == 0
    said = capsys.readouterr().err
    assert "learner: that of particle with policy.p_max = 0.5; the rest as the task has it" in said
    assert main([*command[:-1], str(tmp_path / "own")]) == 0
    assert "learner:" not in capsys.readouterr().err
