"""What Gymnasium environments report in `info`: which keys are read, and what becomes of them in metrics."""

import numpy as np
import pytest
from gymnasium_examples import Reporting

import motorgrad as mg
from motorgrad.cli import main
from motorgrad.learning import Agent, gpomdp
from motorgrad.policies import softmax
from motorgrad.tasks import from_gymnasium
from motorgrad.training import stepper_for


@pytest.fixture
def reporting(register):
    """The id of an environment that reports `report(time)`."""
    return lambda report, **settings: register(lambda **more: Reporting(report, **settings, **more))


def recorded(task, decisions, seeds=(0,)):
    """What is recorded of the first decisions of each seed."""
    stepper = stepper_for(task, Agent(softmax(task), gpomdp(0.0)), seeds)
    stepper.advance(decisions)
    return stepper.harvest()


FORMS = {"bool": bool, "float": float, "numpy": np.bool_, "array": lambda flag: np.array([flag])}


@pytest.mark.ci
@pytest.mark.representatives("bool-solved", "array-success", "numpy-is_success")
@pytest.mark.parametrize("key", ["solved", "success", "is_success"])
@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS)
def test_success_is_read_unasked_under_each_of_its_names(reporting, key, form):
    task = from_gymnasium(reporting(lambda time: {"other": "text", key: form(time > 3)}, cut=5))
    assert task.metric_names == ("return", "length", "success", "solved")
    record = recorded(task, 10)
    np.testing.assert_array_equal([record["success"][0], record["success_count"][0]], [1, 2])
    np.testing.assert_allclose([record["solved"][0], record["solved_count"][0]], [0.4, 10])


@pytest.mark.parametrize(("steps", "succeeds"), [pytest.param(3, 1, marks=pytest.mark.ci), (4, 0)])
def test_an_episode_succeeds_if_it_is_solved_on_enough_steps(reporting, steps, succeeds):
    task = from_gymnasium(reporting(lambda time: {"solved": time in (1, 2, 4)}, cut=5), success_steps=steps)
    record = recorded(task, 15)
    np.testing.assert_allclose([record["success"][0], record["success_count"][0]], [succeeds, 3])


@pytest.mark.ci
def test_held_actions_count_every_step(reporting):
    task = from_gymnasium(reporting(lambda time: {"solved": time in (2, 3)}, cut=6), repeat=3, success_steps=2)
    record = recorded(task, 4)
    np.testing.assert_allclose([record["success"][0], record["solved"][0]], [1, 1 / 3], rtol=1e-6)


@pytest.mark.ci
def test_other_keys_are_read_where_they_are_asked_for(reporting):
    def report(time):
        return {"effort": 2.0 * time, "late": np.nan if time < 3 else time, "is_success": False, "words": "no"}

    task = from_gymnasium(reporting(report, cut=4), info=("effort", "late"))
    assert task.metric_names == ("return", "length", "success", "solved", "effort", "late")
    record = recorded(task, 4)
    np.testing.assert_allclose([record["effort"][0], record["late"][0], record["solved"][0]], [5, 3.5, 0])
    np.testing.assert_array_equal([record["late_count"][0], record["diverged"][0]], [2, 0])


@pytest.mark.ci
def test_a_key_of_the_end_alone_is_found_and_counts_there(reporting):
    task = from_gymnasium(reporting(lambda time: {"score": 7} if time == 5 else {}, end=5), info=("score",))
    record = recorded(task, 10)
    np.testing.assert_array_equal([record["score"][0], record["score_count"][0]], [7, 2])


@pytest.mark.ci
def test_of_several_keys_of_success_the_one_asked_for_means_it(reporting):
    env_id = reporting(lambda time: {"solved": False, "is_success": True}, cut=3)
    assert recorded(from_gymnasium(env_id), 3)["success"] == 0
    asked = from_gymnasium(env_id, info=("is_success",))
    assert asked.metric_names == ("return", "length", "success", "solved")
    assert recorded(asked, 3)["success"] == 1


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (
            {"info": ("efort",)},
            r"unknown info of Mine.*: 'efort': did you mean 'effort'\? known are effort, pose, text",
        ),
        ({"info": ("pose",)}, r"info of Mine.* = 'pose': must be the key of one finite number or flag"),
        ({"info": ("text",)}, "must be the key of one finite number"),
        ({"info": ("return",)}, r"info = 'return': must be another key: metrics have a column"),
        ({"info": ("effort_count",)}, "must be another key"),
        ({"info": ("effort", "effort")}, "must be different keys"),
        ({"success_steps": 0}, "success_steps = 0: must be an integer from 1"),
    ],
)
def test_what_cannot_be_read_is_refused_by_name(reporting, settings, message):
    env_id = reporting(lambda time: {"effort": 1.0, "pose": np.zeros(2), "text": "x"}, cut=3)
    with pytest.raises(ValueError, match=message) as error:
        from_gymnasium(env_id, **settings)
    assert "\n" not in str(error.value)


@pytest.mark.ci
def test_success_is_recorded_kept_and_evaluated(reporting, tmp_path):
    env_id = reporting(lambda time: {"solved": time > 2, "effort": time}, cut=4)
    words = f"train gymnasium --task.env-id {env_id} --task.info effort --task.success-steps 2 --steps 80".split()
    assert main([*words, "--seeds", "2", "--out", str(tmp_path / "run")]) == 0
    run = mg.load(tmp_path / "run")
    np.testing.assert_allclose(run.curve("success")[1][:, -1], 1)
    np.testing.assert_allclose(run.final("solved", 1.0), 0.5)
    found = mg.evaluate(run, 20).metrics
    np.testing.assert_allclose([found["success"], found["solved"], found["effort"]], [[1, 1], [0.5, 0.5], [2.5, 2.5]])
