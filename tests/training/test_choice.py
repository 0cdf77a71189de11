"""The preset that a task gets by itself: what decides, what is said, and that every way in makes the same choice."""

import dataclasses
import math
from typing import Any, ClassVar

import pytest

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.learning import PRESETS, PURPOSES, Agent, SoftActorCritic
from motorgrad.presets import choose
from motorgrad.schema import kind_of
from motorgrad.tasks import TASKS, Composed, from_gymnasium, load, terms
from motorgrad.training import agent_table, check_training, choice_for

POSTURE = {
    "observe": ["joint-positions", "joint-velocities"],
    "reward": [terms.Effort(weight=-1.0), terms.Alive()],
    "time_limit": 1.0,
}


@dataclasses.dataclass(frozen=True)
class Kind:
    """What of a task decides."""

    actions: Any = "continuous"
    observation_size: int = 10
    action_size: int = 4
    longest_episode: int | None = 100
    goal: object = None
    action_range: Any = ((0.0, 1.0), (0.0, 1.0))


@pytest.mark.parametrize(
    ("task", "how", "preset", "reason"),
    [
        (Kind(goal=()), {}, "sac", "its actions are real numbers and it has a goal, for hindsight"),
        (Kind(), {}, "sac", "its actions are real numbers and a replay learns from few decisions"),
        (Kind("discrete"), {}, "sac", "it chooses among few alternatives and a replay learns from few decisions"),
        (Kind("discrete", 5), {}, "natural", "it chooses among alternatives and observes 5 numbers, which fixed"),
        (Kind("discrete", action_size=100), {}, "natural", "it chooses among 100 alternatives"),
        (Kind("binary", goal=()), {}, "natural", "its actions are binary"),
        (Kind(("binary", "continuous")), {}, "natural", "its actions are mixed"),
        (Kind(goal=()), {"envs": 4}, "natural", "4 environments feed each learner"),
        (Kind(goal=()), {"steps": 500}, "natural", "500 decisions are too few to learn from a replay"),
        (Kind(observation_size=7_056), {}, "ppo", "it observes 7,056 numbers"),
        (Kind("discrete", observation_size=7_056), {}, "ppo", "it observes 7,056 numbers"),
    ],
)
def test_what_a_task_is_decides(task, how, preset, reason):
    choice = choose(task, **how)
    assert choice.preset == preset
    assert choice.reason.startswith(reason)
    assert choice.alternative in {*PRESETS} - {preset}
    assert str(choice) == f"preset {preset!r}, because {choice.reason}; preset {choice.alternative!r} {choice.gain}"


@pytest.mark.parametrize(
    ("task", "target"),
    [
        (Kind(), -1.7),
        (Kind(action_range=((-1.0, 1.0),)), math.log(2) - 1.7),
        (Kind(action_range=((-math.inf, math.inf),)), math.log(2) - 1.7),  # as between -1 and 1
        (Kind("discrete", action_size=3), 0.1),
        (Kind("discrete", action_size=3, goal=()), 0.1),
        (Kind(goal=()), None),  # it explores by its targets
    ],
)
def test_what_explores_is_a_finite_entropy_or_the_targets(task, target):
    found = PRESETS["sac"](task, 10_000, None)["entropy_target"]
    assert found == (None if target is None else {"target": pytest.approx(target)})


@pytest.mark.parametrize(("name", "value"), [("steps", 0), ("steps", 1.5), ("envs", 0)])
def test_impossible_numbers_are_refused(name, value):
    with pytest.raises(ValueError, match=rf"^{name} = {value}: must be an integer of at least 1"):
        choose(Kind(), **{name: value})


def test_tasks_of_the_thesis_keep_their_own_learners():
    own = [name for name in TASKS if TASKS[name].learner is not None]
    assert {*TASKS} - {*own} == {"composed", "gymnasium"}
    assert all(choice_for(name) is None for name in own)


def same(agent, task, steps, preset="sac"):
    assert agent_table(agent) == agent_table(mg.agent_for(task, preset=preset, steps=steps))


def test_every_way_in_makes_the_same_choice(tmp_path):
    task = Composed()
    assert task.goal is not None
    same(mg.agent_for(task, steps=5_000), task, 5_000)
    same(mg.agent_for("composed", steps=5_000), task, 5_000)
    same(mg.agent_for("Pendulum-v1", steps=5_000), from_gymnasium("Pendulum-v1"), 5_000)
    (tmp_path / "reach.toml").write_text('name = "composed"\n')
    same(mg.agent_for(load(tmp_path / "reach.toml"), steps=5_000), task, 5_000)
    same(check_training(task, None, 5_000).agent, task, 5_000)
    posture = mg.tasks.compose("arm6", **POSTURE)
    assert posture.goal is None
    assert mg.agent_for(posture, steps=5_000).replay.hindsight is None
    assert mg.agent_for(task, steps=5_000).replay.hindsight is not None


@pytest.mark.parametrize(
    ("changes", "kept"),
    [
        ({"values.discount": 0.9}, True),
        ({"discount": 0.9}, True),
        ({"policy.floor": 0.2}, True),
        ({"estimator.trace.decay": 0.9}, False),
        ({"decay": 0.9}, False),
        ({"policy": "recurrent"}, False),
    ],
)
def test_changes_that_are_meant_for_another_learner_get_natural(changes, kept):
    choice = choice_for("composed", changes)
    assert choice is not None
    assert choice.preset == ("sac" if kept else "natural")
    if not kept:
        named = next(iter(changes))
        assert choice.reason == f"{named} is given, which 'sac' does not take"
    assert isinstance(mg.agent_for("composed", changes), SoftActorCritic if kept else mg.learning.Learner)


def test_a_preset_or_a_kind_that_is_named_is_no_choice():
    assert choice_for("composed", {"preset": "natural"}) is None
    assert choice_for("composed", {"kind": "twin-delayed"}) is None
    assert isinstance(mg.agent_for("composed", preset="natural"), Agent)
    named = mg.agent_for("composed", kind="soft-actor-critic")
    assert named.replay == mg.learning.Replay()  # the numbers of the class, as of any kind that is named


def test_a_sweep_decides_as_changes_do():
    arguments = check_training("composed", None, 5_000, sweep={"decay": [0.9, 0.95]})
    assert arguments.choice.preset == "natural"
    assert arguments.choice.reason.startswith("decay is given")
    assert len(arguments.settings) == 2


def test_training_says_the_choice_in_one_line(capsys):
    mg.train("Pendulum-v1", steps=20, progress=True)
    said = [line for line in capsys.readouterr().err.splitlines() if "because" in line]
    assert said == [f"gymnasium: {choice_for('Pendulum-v1', steps=20)}"]
    mg.train("Pendulum-v1", {"preset": "natural"}, steps=20, progress=True)
    mg.train("Pendulum-v1", steps=20, progress=False)
    assert "because" not in capsys.readouterr().err


def test_the_command_says_the_choice_and_takes_settings_of_another_learner(capsys, tmp_path):
    main(["train", "Pendulum-v1", "--steps", "20", "--out", str(tmp_path / "a")])
    assert f"learner: {choice_for('Pendulum-v1', steps=20)}\n" in capsys.readouterr().err
    main(["train", "Pendulum-v1", "--steps", "20", "--agent.decay", "0.5", "--out", str(tmp_path / "b")])
    assert "learner: that of natural with estimator.trace.decay = 0.5" in capsys.readouterr().err
    main(["train", "Pendulum-v1", "--steps", "2000", "--sweep", "decay=0.5,0.6", "--out", str(tmp_path / "c")])
    assert "learner: preset 'natural', because decay is given" in capsys.readouterr().err
    main(["train", "--resume", str(tmp_path / "b"), "--steps", "40"])
    assert "because" not in capsys.readouterr().err


def test_every_preset_says_what_it_is_for(capsys):
    assert {*PURPOSES} == {*PRESETS}
    assert all(PURPOSES.values())
    main(["list", "presets"])
    said = capsys.readouterr().out
    for name, purpose in PURPOSES.items():
        assert name in said
        assert purpose in said


def test_a_task_of_ones_own_gets_one_by_itself():
    class Own(mg.tasks.Hopper):
        learner: ClassVar[Any] = None

    assert kind_of(mg.agent_for(Own(), steps=5_000).policy) == "hyperplanes"
    assert choice_for(Own()).preset == "natural"
