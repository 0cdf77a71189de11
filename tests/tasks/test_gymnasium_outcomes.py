"""What foreign environments return: anything but what Gymnasium says is refused by environment, step and value."""

import re

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium_examples import Told

from motorgrad.cli import _answer
from motorgrad.tasks import from_gymnasium
from motorgrad.training import agent_for, choice_for


class Odd(Told):
    """In the step `at`, or from its second reset on, `change` makes something else of what it would return."""

    def __init__(self, change, at=2, **settings):
        super().__init__(**settings)
        self.change, self.at, self.resets = change, at, 0

    def reset(self, **given):
        found = super().reset(**given)
        self.resets += 1
        return self.change(*found) if self.at == "reset" and self.resets > 1 else found

    def step(self, action):
        seen, reward, terminated, truncated, _ = super().step(action)
        found = (seen, reward, terminated, truncated, {"effort": 1.0})
        return self.change(*found) if self.time == self.at else found


@pytest.fixture
def odd(register):
    """A task on an environment that returns what `change` makes of it."""

    def one(change, at=2, settings=None, **options):
        name = register(lambda **more: Odd(change, at, **(settings or {}), **more))
        return from_gymnasium(name, **options)

    return one


def fail():
    raise LookupError("out of road")


def instead(place, value):
    return lambda *found: (*found[:place], value, *found[place + 1 :])


TOO_LARGE = 10**400
REFUSED = {
    "reward of an array": (instead(1, np.array([1.0])), "reward = array([1.]): must be one real number"),
    "reward of none": (instead(1, None), "reward = None: must be one real number"),
    "complex reward": (instead(1, np.complex64(1j)), "reward = np.complex64(1j): must be one real number"),
    "reward in words": (instead(1, "1.5"), "reward = '1.5': must be one real number"),
    "huge reward": (instead(1, TOO_LARGE), "must be a real number of double precision"),
    "no end": (instead(2, None), "terminated = None: must be true or false"),
    "end of an array": (instead(2, np.array([False])), "terminated = array([False]): must be true or false"),
    "end in words": (instead(2, "False"), "terminated = 'False': must be true or false"),
    "half an end": (instead(3, 0.5), "truncated = 0.5: must be true or false"),
    "end of no number": (instead(3, np.nan), "truncated = nan: must be true or false"),
    "no info": (instead(4, None), "info = None: must be a dictionary"),
    "a list as info": (instead(4, ["effort"]), "info = ['effort']: must be a dictionary"),
    "words as info": (instead(4, {"effort": "0.5"}), "info['effort'] = '0.5': must be one number or flag, or None"),
    "complex info": (instead(4, {"effort": 1j}), "info['effort'] = 1j: must be one number"),
    "several as info": (instead(4, {"effort": np.zeros(2)}), "info['effort'] = array([0., 0.]): must be one number"),
    "huge info": (instead(4, {"effort": TOO_LARGE}), "must be one number or flag"),
    "more numbers": (instead(0, np.zeros(3)), "observation of shape (3,) and type float64 = array([0., 0., 0.]): must"),
    "another shape": (instead(0, np.zeros((2, 1))), "observation of shape (2, 1)"),
    "no observation": (instead(0, None), "observation of shape () and type object = None: must be numbers of shape"),
    "observation in words": (instead(0, ["1", "2"]), "type <U1 = ['1', '2']: must be numbers of shape (2,)"),
    "complex observation": (instead(0, np.zeros(2, complex)), "type complex128"),
    "dates": (instead(0, np.zeros(2, "M8[s]")), "type datetime64[s]"),
    "a dictionary": (instead(0, {"a": 1}), "type object = {'a': 1}"),
    "different rows": (instead(0, [1, [2, 3]]), "observation = [1, [2, 3]]: must be numbers of shape (2,)"),
    "four values": (lambda *found: found[:4], "must be an observation, a reward, terminated, truncated and an info"),
    "nothing": (lambda *found: None, "step returned = None: must be an observation, a reward"),
}


@pytest.mark.parametrize(("change", "told"), REFUSED.values(), ids=REFUSED)
def test_a_step_that_returns_something_else_is_refused_by_name_and_number(odd, change, told):
    task = odd(change, info=("effort",))
    batch = task.batch([3, 8])
    batch.step(np.zeros((2, 1), np.float32))
    with pytest.raises(ValueError, match=re.escape(told)) as error:
        batch.step(np.zeros((2, 1), np.float32))
    assert str(error.value).startswith(f"step 2 of {task.env_id} of seed 3, action np.int64(0): ")
    assert "\n" not in str(error.value)


ACCEPTED = {
    "flag": (1, True, 1.0),
    "array of no axes": (1, np.array(2.5), 2.5),
    "single precision": (1, np.float32(0.5), 0.5),
    "whole number": (1, 2**70, 2.0**70),
    "end as 0": (2, 0, 2.0),
    "list": (0, [0.5, 0.25], 2.0),
    "flags": (0, np.array([True, False]), 2.0),
}


@pytest.mark.parametrize(("place", "value", "reward"), ACCEPTED.values(), ids=ACCEPTED)
def test_what_is_a_number_in_another_form_is_read(odd, place, value, reward):
    batch = odd(instead(place, value)).batch([3])
    for _ in range(2):
        batch.step(np.zeros((1, 1), np.float32))
    assert batch.unpack(batch.packed[0]).reward == np.float32(reward)
    if place == 0:
        np.testing.assert_array_equal(batch.packed[0, :2], np.asarray(value, np.float32))


@pytest.mark.parametrize("value", [None, np.nan, np.inf, 1e300])
def test_a_number_of_info_may_be_unknown(odd, value):
    batch = odd(instead(4, {"effort": value}), info=("effort",)).batch([3])
    counted = []
    for _ in range(2):
        batch.step(np.zeros((1, 1), np.float32))
        counted.append(float(batch.unpack(batch.packed[0]).info_count[0]))
    assert counted == [1, 0]
    assert not batch.lost


@pytest.mark.parametrize("value", [np.nan, np.inf, 1e300])
def test_a_reward_that_is_not_finite_counts_as_diverged(odd, value):
    batch = odd(instead(1, value)).batch([3])
    lost = []
    for _ in range(2):
        batch.step(np.zeros((1, 1), np.float32))
        lost.append(bool(batch.packed[0, -1]))
    assert lost == [False, True]


def test_steps_of_held_actions_are_counted_each(odd):
    task = odd(instead(1, None), at=5, repeat=3)
    batch = task.batch([4])
    batch.step(np.zeros((1, 1), np.float32))
    with pytest.raises(ValueError, match=r"^step 5 of Mine\d+-v0 of seed 4, action"):
        batch.step(np.zeros((1, 1), np.float32))


RESETS = {
    "an observation alone": (lambda seen, info: seen, "reset returned = array([0., 0.], dtype=float32): must be an"),
    "nothing": (lambda seen, info: None, "reset returned = None: must be an observation and an info"),
    "no info": (lambda seen, info: (seen, None), "info = None: must be a dictionary"),
    "more numbers": (lambda seen, info: (np.zeros(3), info), "observation of shape (3,)"),
    "words": (lambda seen, info: (["1", "2"], info), "type <U1"),
    "no number": (lambda seen, info: (seen + np.nan, info), "must be finite in single precision"),
}


@pytest.mark.parametrize(("change", "told"), RESETS.values(), ids=RESETS)
def test_a_reset_that_returns_something_else_says_after_which_step(odd, change, told):
    task = odd(change, "reset")
    batch = task.batch([3])
    for _ in range(2):
        batch.step(np.zeros((1, 1), np.float32))
    with pytest.raises(ValueError, match=re.escape(told)) as error:
        batch.reset([0])
    assert str(error.value).startswith(f"the reset after step 2 of {task.env_id} of seed 3: ")


def test_an_error_of_a_reset_says_where(odd):
    task = odd(lambda *found: fail(), "reset")
    batch = task.batch([3])
    batch.step(np.zeros((1, 1), np.float32))
    with pytest.raises(LookupError, match="out of road") as error:
        batch.reset([0])
    assert error.value.__notes__ == [f"in the reset after step 1 of {task.env_id} of seed 3"]


def test_what_an_environment_that_was_restored_returns_blames_the_state(odd):
    batch = odd(instead(1, None)).batch([3])
    batch.restore(batch.snapshot())
    batch._restored = True
    batch.step(np.zeros((1, 1), np.float32))
    with pytest.raises(RuntimeError, match=r"fails after it was restored from a checkpoint: step 2 of .* since it was"):
        batch.step(np.zeros((1, 1), np.float32))


class Wrong(gymnasium.Env):
    """Its rewards are arrays of one, and it cannot be reset without a seed."""

    observation_space, action_space = spaces.Box(-1, 1, (2,)), spaces.Discrete(2)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        if seed is None:
            raise ValueError("no road")
        return np.zeros(2, np.float32), {}

    def step(self, action):
        return np.zeros(2, np.float32), np.ones(1), False, False, {}


@pytest.mark.ci
@pytest.mark.filterwarnings("ignore:.*reward returned by")  # of Gymnasium, which says so once
def test_workers_use_the_same_words():
    task, words = from_gymnasium(Wrong), []
    batches = [task.batch([3]), task.batch([3], workers=1)]
    for batch in batches:
        with pytest.raises(ValueError, match="reward") as wrong:
            batch.step(np.zeros((1, 1), np.float32))
        with pytest.raises(ValueError, match="no road") as failed:
            batch.reset([0])
        words.append([type(wrong.value), str(wrong.value), str(failed.value), failed.value.__notes__])
        batch._close()
    assert words[0] == words[1]
    assert words[0][-1] == [f"in the reset after step 0 of {task.env_id} of seed 3"]


def test_a_command_says_where_an_environment_failed(capsys):
    error = ValueError("out of road")
    error.add_note("in step 1 of Failing-v0 of seed 0")
    assert _answer("train", error) == 2
    assert capsys.readouterr().err == "motorgrad train: out of road; in step 1 of Failing-v0 of seed 0\n"


@pytest.mark.parametrize("key", [1, ("a",)])
def test_keys_of_info_that_are_no_texts_are_not_offered(register, key):
    name = register(lambda **more: Odd(instead(4, {key: 1.0, "effort": 1.0}), 1, **more))
    with pytest.raises(ValueError, match=r"unknown info of .*known are effort$"):
        from_gymnasium(name, info=(str(key),))


def test_a_picture_is_refused_in_words_that_help(told):
    task = from_gymnasium(told(observation=spaces.Box(0, 255, (64, 64, 3), np.uint8)))
    with pytest.raises(ValueError, match=r"shows 12,288 numbers, \(64, 64, 3\): make fewer of them with gymnasium\.wr"):
        agent_for(task, preset="natural")
    choice = choice_for(task)
    assert choice is not None
    assert choice.preset == "ppo"
    assert agent_for(task)
