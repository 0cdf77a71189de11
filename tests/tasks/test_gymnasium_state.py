"""Environments saved as plain data: a restored one continues exactly like its original."""

import collections
import enum
import itertools
import json
import random

import gymnasium
import mujoco
import numpy as np
import pytest
from gymnasium_examples import Told

from motorgrad.tasks import from_gymnasium
from motorgrad.tasks.gymnasium._batch import why_not_saved
from motorgrad.tasks.gymnasium._state import NoState, read_state, write_state
from motorgrad.tasks.gymnasium._state_forms import packed

CLASSIC = ["CartPole-v1", "Pendulum-v1", "MountainCar-v0", "Acrobot-v1", "Blackjack-v1", "FrozenLake-v1"]
BODIES = (
    "InvertedPendulum InvertedDoublePendulum Hopper Ant Humanoid HumanoidStandup HalfCheetah Reacher Pusher Swimmer"
)
MUJOCO = [f"{name}-v5" for name in [*BODIES.split(), "Walker2d"]]


def wander(environment, actions):
    """What an environment shows for these actions, with the resets between."""
    seen = []
    for action in actions:
        observation, reward, terminated, truncated, _ = environment.step(action)
        seen.append(np.append(np.ravel(observation), (reward, terminated, truncated)))
        if terminated or truncated:
            seen.append(np.ravel(environment.reset()[0]))
    return [*seen, np.ravel(environment.reset()[0])]


def assert_goes_on(original, copy, trials=3, steps=40):
    """Restore at several places, over a past of the copy's own, and compare what follows, bit for bit."""
    original.action_space.seed(1)
    sample = original.action_space.sample
    original.reset(seed=0)
    copy.reset(seed=5)
    for trial in range(trials):
        wander(copy, [sample() for _ in range(5)])
        wander(original, [sample() for _ in range(11)])
        for _ in range(2 * trial + 1):
            original.step(sample())
        state = write_state(original)
        read_state(state, copy)
        assert write_state(copy) == state
        actions = [sample() for _ in range(steps)]
        for a, b in zip(wander(original, actions), wander(copy, actions), strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.filterwarnings("ignore")
@pytest.mark.representatives("CartPole-v1", "Blackjack-v1", "Hopper-v5", "Ant-v5")
@pytest.mark.parametrize("name", CLASSIC + MUJOCO)
def test_an_environment_goes_on_from_its_data(name):
    assert_goes_on(gymnasium.make(name), gymnasium.make(name))
    assert why_not_saved(name, {}) is None


def test_the_numbers_that_mujoco_derived_are_needed():
    """The Ant reads where it was before it steps; MuJoCo's state alone does not say."""
    original, copy = gymnasium.make("Ant-v5"), gymnasium.make("Ant-v5")
    for environment in (original, copy):
        environment.reset(seed=0)
    actions = [original.action_space.sample() for _ in range(3)]
    for action in actions[:2]:
        original.step(action)
    copy.unwrapped.set_state(original.unwrapped.data.qpos, original.unwrapped.data.qvel)
    assert original.step(actions[2])[1] != copy.step(actions[2])[1]


class Mood(enum.Enum):
    CALM = 1
    WILD = 2


class Part:
    def __init__(self, owner):
        self.owner, self.count = owner, 0


class Rich(Told):
    """It holds what environments hold: aliases, a cycle, a view, queues, generators, switches."""

    def __init__(self):
        super().__init__()
        self.part = Part(self)
        self.memory = np.zeros(4)
        self.window = self.memory[1:3]
        self.twins = [self.memory, self.memory]
        self.queue = collections.deque([0.0], maxlen=3)
        self.mood, self.table = Mood.CALM, {(0, "a"): {1, 2}}
        self.dice, self.old = random.Random(3), np.random.RandomState(4)
        self.late: object = None
        self.blob, self.kind = b"\x00", np.float32(1)

    def step(self, action):
        result = super().step(action)
        self.part.count += 1
        self.part.owner.memory[0] += self.part.count
        self.window += self.dice.random()
        self.queue.append(self.old.normal())
        self.mood = Mood.WILD if self.part.count % 3 else Mood.CALM
        self.table[(self.part.count, "b")] = {self.part.count}
        self.late = self.late or [self.memory]
        self.late[0][3] += self.np_random.normal() + (self.mood is Mood.WILD)
        self.blob, self.kind = self.blob[-3:] + bytes([self.part.count % 256]), self.kind + np.float32(0.1)
        self.told.clear()
        total = self.memory.sum() + sum(self.queue) + len(self.table) + self.twins[1][0] + self.kind + self.blob[-1]
        return result[0], float(total), *result[2:]


def test_what_an_environment_holds_is_restored_and_one_thing_stays_one_thing():
    assert_goes_on(Rich(), Rich())
    copy, original = Rich(), Rich()
    original.reset(seed=1)
    original.step(0)
    copy.reset(seed=2)
    read_state(write_state(original), copy)
    assert copy.part.owner is copy
    assert copy.late[0] is copy.memory is copy.twins[0] is copy.twins[1]
    assert copy.window.base is copy.memory
    assert type(copy.kind) is np.float32


def test_what_is_not_data_is_named():
    environment = Rich()
    environment.part.held = [itertools.count()]
    with pytest.raises(NoState, match=r"part\.held\[0\] is a itertools\.count, whose state cannot be read"):
        write_state(environment)


class Subclass(list):
    pass


@pytest.mark.parametrize("value", [Subclass(), (i for i in ()), memoryview(b""), np.array([object()]), object()])
def test_no_state_is_passed_over(value):
    environment = Rich()
    environment.more = value
    with pytest.raises(NoState, match=r"more is a .*, whose state cannot be read"):
        write_state(environment)


class Redrawn(Told):
    """A model that is drawn anew for each episode: its state belongs to no other."""

    def __init__(self):
        super().__init__()
        self.reset()

    def reset(self, **given):
        seen = super().reset(**given)
        mass = self.np_random.uniform(1, 2)
        self.model = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody><body><freejoint/><geom size='.1' mass='{mass}'/></body></worldbody></mujoco>"
        )
        self.data = mujoco.MjData(self.model)
        return seen


def test_the_state_of_another_model_is_refused():
    original, copy = Redrawn(), Redrawn()
    with pytest.raises(NoState, match=r"does not fit the environment: .*MjModel"):
        read_state(write_state(original), copy)
    gymnasium.register("Redrawn-v0", Redrawn, disable_env_checker=True)
    try:
        assert "MjModel" in why_not_saved("Redrawn-v0", {})
    finally:
        del gymnasium.registry["Redrawn-v0"]


def test_damaged_or_foreign_data_are_refused_whatever_they_are():
    """Mutations of a state: refused in one way, or restored; no other exception."""
    original = gymnasium.make("InvertedPendulum-v5")
    original.reset(seed=0)
    state, chance, refused = write_state(original), np.random.default_rng(0), 0
    copy = gymnasium.make("InvertedPendulum-v5")
    copy.reset(seed=1)
    for _ in range(300):
        content = bytearray(state)
        place = int(chance.integers(len(content)))
        kind = chance.integers(3)
        if kind == 0:
            content[place] = int(chance.integers(32, 127))
        elif kind == 1:
            del content[place : place + int(chance.integers(1, 40))]
        else:
            content[place:place] = chance.choice([b"null", b"[]", b"{}", b'{"met":999}', b"-1", b'"x"'])
        try:
            read_state(bytes(content), copy)
        except NoState:
            refused += 1
    assert refused > 250
    with pytest.raises(NoState):
        read_state(json.dumps({"object": "os.system", "fields": {}}).encode(), copy)
    with pytest.raises(NoState):
        read_state(write_state(original), gymnasium.make("CartPole-v1"))


DEEP = json.loads('{"list": [' * 300 + "0" + "]}" * 300)
ONES = [*packed(np.ones(4))]
CRAFTED = {
    "objects over bytes": {"view": ["O", 0, [1], [8]], "of": {"array": ONES}},
    "records over bytes": {"view": ["O,O", 0, [1], [16]], "of": {"array": ONES}},
    "a view of more": {"view": ["<f8", 0, [5], [8]], "of": {"array": ONES}},
    "a view before its beginning": {"view": ["<f8", 8, [2], [-16]], "of": {"array": ONES}},
    "a view of another thing": {"view": ["<f8", 0, [1], [8]], "of": {"bytes": "AAAAAAAAAAA="}},
    "objects": {"array": ["O", "C", [1], "AAAAAAAAAAA="]},
    "more numbers than there are": {"array": ["<f8", "C", [2**39], ""]},
    "no numbers of a kind": {"array": ["<f8", "C", [0, 2**39], "AA=="]},
    "another order": {"array": ["<f8", "K", [0], ""]},
    "half a number": {"array": ["<f8", "C", [1.5], "AAAAAAAAAAA="]},
    "depth": DEEP,
    "one that is not there": {"met": 7},
    "one before the first": {"met": -1},
    "two forms": {"list": [], "set": []},
    "no form": {},
    "an unknown form": {"call": "os.system"},
    "dates": {"array": ["<M8[s]", "C", [1], "AAAAAAAAAAA="]},
}


@pytest.mark.parametrize("name", CRAFTED)
def test_crafted_states_touch_neither_memory_nor_the_environment(name):
    """Each is put in the place of an attribute. Some of them once were read at any address."""
    environment = Rich()
    environment.reset(seed=0)
    before = write_state(environment)
    stored = json.loads(before)
    stored["fields"]["memory"] = CRAFTED[name]
    with pytest.raises(NoState):
        read_state(json.dumps(stored).encode(), environment)
    if name not in (
        "one that is not there",
        "a view of more",
        "a view before its beginning",
        "a view of another thing",
    ):
        assert write_state(environment) == before  # refused as a whole, before anything was assigned


TWISTED = {
    "a place far beyond": ("MT19937", "pos", 10**9),
    "a place before": ("MT19937", "pos", -1),
    "no place": ("MT19937", "pos", "1"),
    "zeros for ever": ("MT19937", "key", np.zeros(624, np.uint32)),
    "a place before the buffer": ("Philox", "buffer_pos", -100),
    "a place behind the buffer": ("Philox", "buffer_pos", 5),
    "one number for ever": ("PCG64", "inc", 0),
}


@pytest.mark.parametrize("old", [False, True])
@pytest.mark.parametrize("name", TWISTED)
def test_generators_take_only_states_that_they_come_to(name, old):
    """NumPy follows the positions anywhere in memory, and draws from some states for ever, whatever is asked of it."""
    kind, place, value = TWISTED[name]
    environment = Rich()
    generator = getattr(np.random, kind)(0)
    environment.chance = np.random.RandomState(generator) if old else np.random.Generator(generator)
    before = write_state(environment)
    read_state(before, environment)
    stored = json.loads(before)
    outer = stored["fields"]["chance"]["generator"]["dict"]
    inner = dict(outer)["state"]["dict"]
    (pair,) = (pair for pair in [*outer, *inner] if pair[0] == place)
    pair[1] = {"array": packed(value)} if isinstance(value, np.ndarray) else value
    with pytest.raises(NoState, match=place):
        read_state(json.dumps(stored).encode(), environment)


def test_the_dice_of_python_are_not_all_zero():
    environment = Rich()
    stored = json.loads(write_state(environment))
    words = stored["fields"]["dice"]["generator"]["tuple"][1]["tuple"]
    words[:624] = [0] * 624
    with pytest.raises(NoState, match="key"):
        read_state(json.dumps(stored).encode(), environment)


@pytest.mark.parametrize("place", [-1e6, 8, 0.5, np.nan])
def test_the_history_of_a_delay_keeps_its_place_within_it(place):
    """MuJoCo writes a delayed control where its history says, even before its memory."""
    environment = Rich()
    environment.model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><body><joint name='x' type='slide'/><geom size='.1'/></body></worldbody>"
        "<actuator><motor joint='x' delay='0.01' nsample='8'/></actuator></mujoco>"
    )
    environment.data = mujoco.MjData(environment.model)
    mujoco.mj_step(environment.model, environment.data)
    read_state(write_state(environment), environment)
    environment.data.history[1] = place
    with pytest.raises(NoState, match="actuator_history"):
        read_state(write_state(environment), environment)


@pytest.mark.parametrize("content", [packed(np.ones(1)), packed(np.ones(4, np.float32)), packed(np.ones((2, 2)))])
def test_memory_of_a_library_takes_its_own_shape_and_type_alone(content):
    environment = Rich()
    environment.model = mujoco.MjModel.from_xml_string("<mujoco/>")
    environment.data = mujoco.MjData(environment.model)
    environment.seen = environment.data.energy
    stored = json.loads(write_state(environment))
    assert "shared" in stored["fields"]["seen"]
    stored["fields"]["seen"] = {"shared": content}
    with pytest.raises(NoState, match="of the shape and type that is there"):
        read_state(json.dumps(stored).encode(), environment)


def test_a_task_says_that_mujoco_is_resumed():
    assert from_gymnasium("Hopper-v5").no_resume is None
