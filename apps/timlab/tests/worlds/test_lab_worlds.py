"""Blocks of tasks against the tasks' own functions, called one after the other with the same numbers."""

import zlib

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import motorgrad as mg
import timlab
from timlab.blocks.worlds._tasks import TASK_NAMES
from timlab.compiler import SPAN, draw_span, draw_start

SEEDS = [2, 5]
SETTINGS = {
    "chain": {"time_limit": 7},
    "linear-recruitment": {"size_ratio": 2.0, "drift": {"amount": -0.3, "period": 20}},
    "particle": {"observation_noise": 0.01},
    "particle-navigation": {"units": 4, "time_limit": 9},
    "three-state": {"time_limit": 5},
}


def acting(world, task):
    """A diagram in which a policy of chance acts in a world."""
    made = timlab.Diagram(tick=task.period)
    made.add("world", world)
    seen, size = task.observation_size, task.action_size
    policy = timlab.Softmax(size, seen) if task.actions == "discrete" else timlab.Hyperplanes(size, seen)
    made.add("policy", policy)
    made.connect("world.observation", "policy.observation")
    made.connect("policy.action", "world.action")
    return made


def watched(diagram, ticks, action="policy.action"):
    ports = [f"world.{name}" for name in diagram.nodes["world"].block.outputs]
    record = timlab.Run(diagram, SEEDS, watch=[*ports, action]).advance(ticks)
    return {address.removeprefix("world."): signal for address, signal in record.signals.items()}


def by_hand(task, seed, actions):
    """What a task shows of these actions, one decision at a time."""
    world, name = task.dynamics, np.uint32(zlib.crc32(b"world"))
    sizes = [world.uniforms, task.uniforms]
    again = [world.reset_uniforms, task.init_uniforms, task.uniforms]
    sizes += again if task.has_episodes else []
    step, pay, look_at = jax.jit(world.step), jax.jit(task.reward), jax.jit(task.observe)
    begin, init, renew = jax.jit(world.reset), jax.jit(task.init), jax.jit(task.renew)
    reset, memory, look = np.split(np.asarray(draw_start(seed, name, sum(again))), np.cumsum(again)[:-1])
    state = begin(reset)
    memory, observation = look_at(init(memory), state, look)
    drawn = np.asarray(draw_span(seed, name, 0, sum(sizes)))
    assert len(actions) <= SPAN
    shown, elapsed = [(observation, 0.0, False, observation)], 0
    for tick, action in enumerate(actions[:-1]):
        chance, observe, *rest = np.split(drawn[tick], np.cumsum(sizes)[:-1])
        state = step(state, action, chance)
        memory, reward, terminated = pay(memory, state, action)
        memory, reached = look_at(memory, state, observe)
        elapsed += 1
        ended = bool(terminated) or (task.episode_limit is not None and elapsed >= task.episode_limit)
        observation = reached
        if ended:
            state, elapsed = begin(rest[0]), 0
            memory, observation = look_at(renew(memory, rest[1]), state, rest[2])
        shown.append((observation, reward, ended, reached))
    return [np.asarray(part) for part in zip(*shown, strict=True)]


QUICK = ("chain", "linear-recruitment")


@pytest.mark.representatives("chain")
@pytest.mark.parametrize("name", [n if n in QUICK else pytest.param(n, marks=pytest.mark.slow) for n in TASK_NAMES])
def test_a_world_shows_what_the_task_says(name):
    settings = SETTINGS.get(name, {})
    task = mg.make(name, **settings)
    seen = watched(acting(timlab.World(name, settings), task), 14)
    assert task.period > 0
    for row, seed in enumerate(SEEDS):
        observation, reward, ended, reached = by_hand(task, seed, seen["policy.action"][row])
        np.testing.assert_allclose(seen["observation"][row], observation, rtol=2e-5, atol=2e-5)
        np.testing.assert_allclose(seen["reward"][row], reward, rtol=2e-4, atol=2e-5)
        np.testing.assert_allclose(seen["next_observation"][row], reached, rtol=2e-5, atol=2e-5)
        np.testing.assert_array_equal(seen["ended"][row], ended)
    assert seen["ended"].any() == ("time_limit" in settings)
    np.testing.assert_array_equal(seen["valid"][:, :2], [[False, True]] * len(SEEDS))


def test_a_body_shows_what_the_task_says_and_begins_anew_after_its_time():
    settings = {"time_limit": 0.2}
    task = mg.make("hopper", **settings)
    made = timlab.Diagram(tick=task.period)
    made.add("world", timlab.Body("hopper", settings))
    made.add("policy", timlab.Pulse(frequency=(11.0, 7.0), shape=(2,)))
    made.connect("policy", "world.action")
    seen = watched(made, 45, "policy.y")
    batch = task.batch(SEEDS)
    memory = jax.vmap(lambda seed: task.init(jnp.zeros(0)))(jnp.arange(2))
    rewards, observations = [np.zeros(2)], []
    look, pay = jax.jit(jax.vmap(lambda m, s: task.observe(m, s, jnp.zeros(0))[1])), jax.jit(jax.vmap(task.reward))
    for tick in range(44):
        observations.append(look(memory, batch.unpack(batch.packed.copy())))
        batch.step(seen["policy.y"][:, tick])
        memory, reward, _ = pay(memory, batch.unpack(batch.packed.copy()), seen["policy.y"][:, tick])
        rewards.append(reward)
        if tick % 20 == 19:
            batch.reset()
            memory = jax.tree.map(jnp.zeros_like, memory)
    np.testing.assert_allclose(seen["observation"][:, :44], np.stack(observations, 1), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(seen["reward"], np.stack(rewards, 1), rtol=1e-5, atol=1e-5)
    np.testing.assert_array_equal(np.flatnonzero(seen["truncated"][0]), [20, 40])
    assert not seen["terminated"].any()


@pytest.mark.parametrize("made", [timlab.Body("hopper"), timlab.MujocoModel()], ids=["hopper", "pendulum"])
def test_a_body_goes_back_to_where_it_was_saved(made):
    diagram = timlab.Diagram(tick=0.01)
    diagram.add("body", made)
    name, port = next(iter(made.inputs.items()))
    diagram.add("wave", timlab.Sine(frequency=7.0, phase=0.5, shape=port.shape))
    diagram.connect("wave", f"body.{name}")
    watch = [f"body.{name}" for name in made.outputs]
    run = timlab.Run(diagram, 3, watch=watch)
    run.advance(30)
    state = run.state
    first = run.advance(20)
    other = run.fork()
    run.restore(state)
    second = run.advance(20)
    for address in watch:
        np.testing.assert_array_equal(first[address], second[address])
    ahead = [each.advance(5)[watch[0]] for each in (run, other)]
    np.testing.assert_array_equal(*ahead)
    assert np.ptp(first[watch[0]]) > 0


def test_settings_are_a_table_or_its_text():
    assert timlab.World("chain", {"length": 4}) == timlab.World("chain", "length = 4")
    nested = timlab.Body("hopper", {"body": {"load_mass": 3.0}})
    assert nested.instance.body.load_mass == 3.0
    assert nested.settings == "[body]\nload_mass = 3.0"


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: timlab.World("chain", "length = "), "settings = 'length = '.*TOML"),
        (lambda: timlab.World("chain", "lenght = 4"), "did you mean 'length'"),
        (lambda: timlab.World("chain", "length = 1"), "length = 1: must be an integer"),
        (lambda: timlab.World("chain", {"length": object()}), "numbers, strings, lists and tables only"),
        (lambda: timlab.World("chain", 4), "settings = 4: must be a string or a table"),
        (lambda: timlab.World("chian"), "did you mean 'chain'"),
        (lambda: timlab.Body("chain"), "unknown task 'chain'"),
    ],
)
def test_what_no_task_has_is_refused(make, told):
    with pytest.raises(ValueError, match=told) as raised:
        make()
    assert "\n" not in str(raised.value)
