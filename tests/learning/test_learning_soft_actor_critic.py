"""Soft actor-critic: what replay keeps and draws, targets in hindsight, values by the formulas, bandits it solves."""

import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest
from compiled_learner import decision

import motorgrad as mg
from motorgrad.learning import (
    ActionValueEnsemble,
    Adam,
    ConjugateAscent,
    Drawn,
    EntropyTarget,
    FisherMetric,
    Goal,
    Hindsight,
    Replay,
    SoftActorCritic,
    Transition,
    TwinDelayed,
)
from motorgrad.policies import (
    Architecture,
    Autoregressive,
    GradedHyperplanes,
    Hyperplanes,
    MultilayerPerceptron,
    Softmax,
    bounded_hyperplanes,
    split,
)
from motorgrad.tasks import Composed, compose, terms
from motorgrad.training import stepper_for

CENTRE = 0.7
SMALL = {"kind": "perceptron", "hidden": [8], "layer_norm": False, "sparsity": 0.0}


def unit() -> Any:
    return GradedHyperplanes(weights=jnp.array([[0.2]]), bias=jnp.array([-0.1]), log_deviation=jnp.array([-1.0]))


class Bowl(eqx.Module):
    """A single feature, −(a − 0.7 y)²."""

    def __call__(self, x):
        return -jnp.square(x[1:] - CENTRE * x[:1])


class Bowls(Architecture):
    """Layers whose output is that of `Bowl`."""

    def build(self, inputs, key):
        return Bowl()


# -- replay


def filled(replay, episodes, dropped=()):
    """Experience of `episodes`, lists of lengths. Observation t of episode e is (e, t), and so are action and reward.
    The decisions in `dropped` diverge."""
    rows = [(episode, t, length) for episode, length in enumerate(episodes) for t in range(length)]
    episode, t, length = np.array(rows, np.float32).T
    lost = np.array([row[:2] in dropped for row in rows])
    seen, following = np.stack([episode, t], axis=1), np.stack([episode, np.where(lost, np.nan, t + 1)], axis=1)
    rewards = np.where(lost, np.nan, 100 * episode + t)
    return kept_of(replay, seen, -t[:, None], rewards, following, t == length - 1, lost, t == length - 1)


def kept_of(replay, seen, actions, *rest):
    """Experience of some decisions; the last of `rest` says after which of them an episode ends."""

    @jax.jit
    def add_all(told):
        def add(kept, now):
            *decision, ended = now
            kept = replay.add(kept, *decision)
            fresh = replay.restart(replay.restart(kept))  # the second time changes nothing
            return jax.tree.map(lambda new, old: jnp.where(ended, new, old), fresh, kept), None

        start = replay.init(jnp.zeros(seen.shape[1]), jnp.zeros(actions.shape[1]), jax.random.key(0))
        return jax.lax.scan(add, start, told)[0]

    return add_all((seen, actions, *rest))


@pytest.mark.ci
@pytest.mark.representatives("oldest-lost")
@pytest.mark.parametrize(
    ("capacity", "episodes", "dropped", "expected"),
    [
        (40, [3, 5], (), [(0, 0), (0, 1), (0, 2), (1, 0), (1, 1), (1, 2), (1, 3), (1, 4)]),
        (6, [3, 5], (), [(1, 0), (1, 1), (1, 2), (1, 3), (1, 4)]),  # the newest six observations
        (7, [30], (), [(0, t) for t in range(24, 30)]),
        (40, [2, 2, 2], ((1, 1), (2, 0)), [(0, 0), (0, 1), (1, 0), (2, 1)]),
    ],
    ids=["all", "oldest-lost", "one-long-episode", "diverged"],
)
def test_each_decision_is_drawn_with_what_it_led_to(capacity, episodes, dropped, expected):
    replay = Replay(capacity, 2, batch=2_000)
    kept = filled(replay, episodes, dropped)
    drawn = jax.tree.map(np.asarray, jax.jit(replay.draw)(kept, jax.random.key(1)))
    assert all(np.isfinite(each).all() for each in drawn)
    rows = drawn.weight > 0
    episode, t = drawn.observation[rows].astype(int).T
    assert set(zip(episode.tolist(), t.tolist(), strict=True)) == set(expected)
    np.testing.assert_array_equal(drawn.next_observation[rows], np.stack([episode, t + 1], axis=1))
    np.testing.assert_array_equal(drawn.action[rows, 0], -t)
    np.testing.assert_array_equal(drawn.reward[rows], 100 * episode + t)
    np.testing.assert_array_equal(drawn.terminated[rows], t == np.array(episodes)[episode] - 1)
    share = np.bincount(100 * episode + t)
    share = share[share > 0] / rows.sum()
    assert np.abs(share - 1 / len(expected)).max() < 0.05  # all alike


def test_the_mean_of_a_batch_leaves_out_rows_without_a_decision():
    drawn = Drawn(*(jnp.zeros(()),) * 5, weight=jnp.array([1.0, 0.0, 1.0]))
    assert float(drawn.mean(jnp.array([2.0, 50.0, 4.0]))) == 3
    assert float(drawn._replace(weight=jnp.zeros(3)).mean(jnp.ones(3))) == 0


@pytest.mark.ci
@pytest.mark.representatives("1.0-3.0")
@pytest.mark.parametrize(("share", "ahead"), [(0.0, 3.0), (1.0, 3.0), (0.5, 1.0)])
def test_in_hindsight_a_later_place_is_the_target(share, ahead):
    """Places 2 t with the target at 50: all errors are those for another place of the same episode, or as they were."""
    goal = Goal((1,), lambda error: -jnp.abs(error[0]) + 7.0 * (error[0] == 0), (3,))
    replay = Replay(100, 2, batch=4_000, hindsight=Hindsight(share, ahead, 0.0))
    length = 20
    episode, t = np.divmod(np.arange(2 * length, dtype=np.float32), length)
    seen, following = (np.stack([episode, 50 - 2 * each, each, 0 * t + 50], axis=1) for each in (t, t + 1))
    never = np.zeros(2 * length, bool)
    rewards = np.asarray(jax.jit(jax.vmap(goal.reward))(following[:, 1:2])) + 0.25
    kept = kept_of(replay, seen, np.zeros((2 * length, 1)), rewards, following, never, never, t == length - 1)
    both = jax.jit(lambda key: (replay.draw(kept, key, goal), replay.draw(kept, key)))(jax.random.key(2))
    drawn, plain = jax.tree.map(np.asarray, both)
    rows = drawn.weight > 0
    error, t, target = drawn.observation[rows, 1:].T
    following, _, same = drawn.next_observation[rows, 1:].T
    np.testing.assert_array_equal(error, target - 2 * t)
    np.testing.assert_array_equal(same, target)
    np.testing.assert_array_equal(following, target - 2 * (t + 1))
    np.testing.assert_array_equal(drawn.observation[:, [0, 2]], plain.observation[:, [0, 2]])
    other = target != 50
    later = target[other] / 2 - t[other]
    assert np.all(later >= 1)
    assert target[other].max(initial=0) <= 2 * length
    np.testing.assert_allclose(drawn.reward[rows], -np.abs(following) + 7.0 * (following == 0) + 0.25, atol=1e-5)
    inside = share * (1 if ahead == 1 else 1 - np.mean((1 - 1 / ahead) ** (length - t)))
    assert abs(other.mean() - inside) < 0.03
    early = later[t[other] < 3]
    if share and ahead > 1:
        assert abs(early.mean() - ahead) < 0.3
    else:
        assert np.all(later == 1)


@pytest.mark.ci
@pytest.mark.parametrize("shown", [True, False], ids=["target-shown", "place-shown"])
def test_in_hindsight_the_target_of_another_episode_is_the_target(shown):
    """Places t − 5, and targets 50 + 10 e of episode e: each of the four targets for 0.6 of the decisions."""
    goal = (
        Goal((0,), lambda error: -jnp.abs(error[0]), (2,)) if shown else Goal((0,), lambda e: -jnp.abs(e[0]), (), (1,))
    )
    replay = Replay(100, 2, batch=4_000, hindsight=Hindsight(0.6, others=1.0))
    episode, t = np.divmod(np.arange(80, dtype=np.float32), 20)
    target, never = 50 + 10 * episode, np.zeros(80, bool)
    seen, following = (np.stack([target - at, at, target, episode], axis=1) for at in (t - 5, t - 4))
    rewards = np.asarray(jax.jit(jax.vmap(goal.reward))(following[:, :1])) + 0.25
    kept = kept_of(replay, seen, np.zeros((80, 1)), rewards, following, never, never, t == 19)
    drawn = jax.tree.map(np.asarray, jax.jit(lambda key: replay.draw(kept, key, goal))(jax.random.key(2)))
    rows = drawn.weight > 0
    error, place, target, episode = drawn.observation[rows].T
    own = 50 + 10 * episode
    np.testing.assert_array_equal(
        drawn.next_observation[rows], np.stack([error - 1, place + 1, target, episode], axis=1)
    )
    np.testing.assert_allclose(drawn.reward[rows], -np.abs(error - 1) + 0.25, atol=1e-5)
    np.testing.assert_array_equal(target, error + place if shown else own)
    for other in (50, 60, 70, 80):
        assert abs(np.mean((error + place)[own != other] == other) - 0.6 / 4) < 0.03
    assert abs(np.mean(error + place == own) - (0.4 + 0.6 / 4)) < 0.03


def arm(scaling: Any = "none", **changes: Any) -> Any:
    settings = {
        "targets": [terms.Reach("hand")],
        "observe": ["joint-positions", terms.TargetError(scale=3.0), "joint-velocities"],
        "reward": [terms.Distance(), terms.Within(weight=2.0), terms.Effort(weight=-0.1)],
        "metrics": ["distance"],
        "time_limit": 1.0,
    }
    return compose("arm6", scaling=scaling, **{**settings, **changes})


def test_the_goal_of_a_composed_task_gives_the_reward_for_another_target():
    task = arm()
    places = [index for index, name in enumerate(task.observation_names) if "error" in name]
    assert (list(task.goal.errors), task.goal.targets) == (places, ())
    shown = Composed(scaling="none")
    both = [[k for k, name in enumerate(shown.observation_names) if word in name] for word in ("error", "target ")]
    assert list(shown.goal.errors) == both[0]
    assert list(shown.goal.targets) == [place for place in both[1] if place not in both[0]]
    placed = arm(observe=[terms.Positions("hand", scale=3.0), terms.TargetError(scale=3.0), terms.Positions("hand")])
    assert (placed.goal.errors, placed.goal.actual) == ((3, 4, 5), (0, 1, 2))  # of the same scale
    assert (shown.goal.actual, task.goal.actual) == ((), ())
    posed = arm(targets=[terms.Pose()], observe=["joint-velocities", "joint-positions", "target-error"])
    assert (posed.goal.errors, posed.goal.actual) == ((4, 5), (2, 3))
    for error in ([0.3, -0.1, 0.2], [0.01, 0.02, -0.01]):
        distance = math.sqrt(sum(each * each for each in error))
        wanted = -distance + 2.0 * (distance < 0.05)
        assert float(task.goal.reward(3.0 * jnp.array(error))) == pytest.approx(wanted, rel=1e-5)


def test_drawn_decisions_are_shown_as_policies_see_them_now():
    """Hindsight moves errors in their own units, and what it moves is scaled by the present statistics."""
    replay = Replay(100, 2, batch=50, hindsight=Hindsight(1.0, 2.0, 0.0))
    kept = filled(replay, [8, 12])
    goal = Goal((1,), lambda error: -jnp.abs(error[0]))
    plain = replay.draw(kept, jax.random.key(3), goal)
    shown = replay.draw(kept, jax.random.key(3), goal._replace(shown=lambda raw: 10 * raw - 1))
    np.testing.assert_allclose(shown.observation, 10 * plain.observation - 1)
    np.testing.assert_allclose(shown.next_observation, 10 * plain.next_observation - 1)
    np.testing.assert_array_equal(shown.reward, plain.reward)


@pytest.mark.ci
def test_hindsight_keeps_raw_observations_of_a_task_that_scales():
    task = arm("running")
    stepper = stepper_for(task, preset_for(task), [0])
    stepper.advance(60)
    cycle = jax.tree.map(lambda leaf: leaf[0], stepper.state["cycle"])
    experience = cycle.agent.experience
    np.testing.assert_array_equal(experience.observations[experience.place], cycle.raw)
    seen = task.observation_code.encode(cycle.memory.mean, cycle.memory.variance, cycle.raw)
    np.testing.assert_allclose(seen, cycle.observation, rtol=1e-5)
    assert np.abs(cycle.observation - cycle.raw).max() > 0.1


def test_it_learns_which_alternative_is_the_best():
    r"""By the mean over all alternatives: with a worth of entropy $\alpha$, probabilities go as $e^{Q/\alpha}$."""
    worth = 0.4
    rewards = jnp.array([0.0, 1.0, 0.2])
    network = MultilayerPerceptron(hidden=(16,), layer_norm=False, sparsity=0.0)
    agent = SoftActorCritic(
        Softmax(jnp.zeros((3, 1))),
        values=ActionValueEnsemble(discount=0.0, learning_rate=0.02, network=network),
        replay=Replay(300, 20, batch=32),
        entropy=worth,
        optimizer=Adam(0.02),
    )
    state = agent.init(jax.random.key(1))
    one = jnp.ones(1)

    @eqx.filter_jit
    def step(state, uniforms):
        state, action = agent.act(state, one, uniforms)
        return agent.update(agent.observe(state, Transition(one, action, rewards[action], one)))

    for uniforms in np.random.default_rng(0).random((400, 1)):
        state = step(state, jnp.asarray(uniforms, jnp.float32))
    np.testing.assert_allclose(state.policy.prob(one), jax.nn.softmax(rewards / worth), atol=0.05)
    values = agent.values.values(state.values.weights, jnp.ones((3, 1)), jnp.eye(3))
    np.testing.assert_allclose(values, np.stack([rewards, rewards]), atol=0.1)


WITHOUT_A_GOAL = pytest.mark.parametrize(
    "changes",
    [
        {"observe": ["joint-positions"]},
        {"observe": ["joint-positions", "target-error", "distance"]},
        {"observe": ["target", terms.TargetError(scale=2.0)]},
        {"reward": [terms.Effort(weight=-0.1)]},
        {"targets": [terms.Reach("hand"), terms.Reach("hand", name="other")]},
        {"targets": [terms.Follow("hand", time=(0, 1), values=((0, 0, 0), (1, 1, 1)))]},
        {"reward": [terms.Distance(), terms.Success()]},
    ],
    ids=[
        "no error",
        "distance observed",
        "two scales",
        "no distance",
        "two targets",
        "it moves",
        "another term",
    ],
)


@WITHOUT_A_GOAL
def test_some_tasks_have_no_goal(changes):
    assert arm(**changes).goal is None


@pytest.mark.ci
@WITHOUT_A_GOAL
def test_tasks_without_a_goal_take_no_hindsight(changes):
    task = arm(**changes)
    agent = mg.agent_for(task, preset="sac", steps=1_000)
    assert agent.replay.hindsight is None
    agent = mg.agent_for(task, {"replay.hindsight": "hindsight"}, preset="sac", steps=1_000)
    with pytest.raises(ValueError, match=r"^replay\.hindsight: needs a goal, but the task 'composed' has none"):
        mg.train(task, agent, 100, progress=False)


# -- values and policy


def batch(count=64):
    rng = np.random.default_rng(0)
    look, action = rng.normal(size=(count, 1)), rng.normal(size=(count, 1))
    reward, ends = rng.normal(size=count), np.arange(count) % 5 == 0
    weight = (np.arange(count) % 7 > 0).astype(float)
    return Drawn(look, action, reward, look + 0.3, ends, weight)


def test_a_step_of_the_values_is_that_of_the_formulas():
    values = ActionValueEnsemble(0.9, 0.01, 0.25, 2, MultilayerPerceptron((4,), layer_norm=False, sparsity=0.0))
    worth = 0.2

    @jax.jit
    def both(drawn, key):
        """The weights and the slow weights after a step of `values`, and by the formulas."""
        policy = unit()
        agent = SoftActorCritic(policy, values, entropy=worth)
        state = agent.init(jax.random.key(0))
        first = enumerate(state.values.weights)
        heads = [eqx.tree_at(lambda w: w.weights, each, jnp.arange(4.0) + k) for k, each in first]
        learned, settings = split(tuple(heads))
        slow = jax.tree.map(lambda leaf: 0.8 * leaf, learned)
        state = state._replace(values=state.values._replace(weights=tuple(heads), slow=slow))
        after = agent.update_from_batch(state, drawn, key).values
        numbers = jax.random.uniform(jax.random.split(key)[0], (64, 1), jnp.float64)
        action = jax.vmap(policy.sample)(drawn.next_observation, numbers)

        def network(learned, look, action):
            heads = eqx.combine(learned, settings)
            return jnp.stack([jax.vmap(m)(jnp.concatenate([look, action], axis=1)) for m in heads])

        later = network(slow, drawn.next_observation, action).min(axis=0)
        later += worth * jax.vmap(policy.entropy)(drawn.next_observation)
        wanted = drawn.reward + 0.9 * (1 - drawn.terminated) * later

        def loss(learned):
            each = network(learned, drawn.observation, drawn.action)
            return 0.5 * jnp.sum(drawn.weight * jnp.sum((each - wanted) ** 2, axis=0)) / jnp.sum(drawn.weight)

        moves, _ = optax.adam(0.01).update(jax.grad(loss)(learned), optax.adam(0.01).init(learned))
        expected = eqx.apply_updates(learned, moves)
        tracked = jax.tree.map(lambda old, new: old + 0.25 * (new - old), slow, expected)
        return (split(after.weights)[0], after.slow), (expected, tracked)

    with jax.enable_x64(True):
        found, expected = both(batch(), jax.random.key(3))
        for one, other in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
            np.testing.assert_allclose(one, other, atol=1e-7)


@pytest.mark.parametrize("autocorrelation", [0.0, pytest.param(0.8, marks=pytest.mark.ci)])
def test_where_the_value_is_known_the_gradient_is_exact(autocorrelation):
    """E Q = −((m − c)² + s²) at each observation, and a nat of entropy log s is worth 0.3. Lasting noise counts as
    independent."""
    with jax.enable_x64(True):
        policy: Any = unit()
        policy = Autoregressive(policy, autocorrelation) if autocorrelation else policy
        agent = SoftActorCritic(policy, ActionValueEnsemble(members=1, network=Bowls()), entropy=0.3)
        state = agent.values.init(2, jnp.float64, jax.random.key(0))
        (head,) = state.weights
        state = state._replace(weights=(eqx.tree_at(lambda w: w.weights, head, jnp.ones(1)),))
        drawn = jax.tree.map(lambda each: np.repeat(each, 500, axis=0), batch())
        found = jax.jit(lambda key: agent._gradient(state, policy, drawn, 0.3, key))(jax.random.key(1))
        found = found.policy if autocorrelation else found
        look, weight = np.asarray(drawn.observation)[:, 0], np.asarray(drawn.weight)
        of_m, s = -2 * (0.2 * look - 0.1 - CENTRE * look), 0.02 + math.exp(-1.0)
        mean = lambda values: np.average(values, weights=weight)  # noqa: E731
        np.testing.assert_allclose(found.bias[0], mean(of_m), atol=0.02)
        np.testing.assert_allclose(found.weights[0, 0], mean(look * of_m), atol=0.02)
        np.testing.assert_allclose(found.log_deviation[0], (-2 * s + 0.3 / s) * math.exp(-1.0), atol=0.02)


def bandit(decisions, key=0, **settings):
    """The state of a learner after decisions each of which is an episode: reward −(a − 0.7 y)² for y in [−1, 1]."""
    agent = SoftActorCritic(unit(), update_every=4, optimizer=Adam(1e-2), **settings)

    def one(state, key):
        first, second, drawn = jax.random.split(key, 3)
        look = jax.random.uniform(first, (1,), minval=-1, maxval=1)
        following = jax.random.uniform(second, (1,), minval=-1, maxval=1)

        def reward(action):
            return -jnp.sum(jnp.square(action - CENTRE * look))

        numbers = jax.random.uniform(drawn, (1,))
        return decision(agent, state, look, numbers, reward, following, terminated=True).state, None

    keys = jax.random.split(jax.random.key(key + 1), decisions)
    return jax.jit(lambda state, keys: jax.lax.scan(one, state, keys)[0])(agent.init(jax.random.key(key)), keys)


@pytest.mark.ci
def test_it_solves_a_bandit_and_deviations_shrink_to_their_floor():
    network = MultilayerPerceptron((32,), activation="tanh", sparsity=0.0, layer_norm=False)
    values = ActionValueEnsemble(learning_rate=1e-2, tracking=0.05, network=network)
    state = bandit(1_500, values=values, replay=Replay(3_000, 100, 64, 4))
    policy = state.policy
    assert float(policy.weights[0, 0]) == pytest.approx(CENTRE, abs=0.1)
    assert float(policy.bias[0]) == pytest.approx(0, abs=0.1)
    assert float(policy.deviation[0]) < 0.25


@pytest.mark.ci
def test_the_worth_of_entropy_is_learned_until_entropy_is_as_wanted():
    network = MultilayerPerceptron((32,), activation="tanh", sparsity=0.0, layer_norm=False)
    values = ActionValueEnsemble(learning_rate=1e-2, tracking=0.05, network=network)
    wanted = 0.3  # a deviation, of which entropy is a function
    target = EntropyTarget(math.log(wanted) + 0.5 * math.log(2 * math.pi * math.e), start=0.5, learning_rate=0.02)
    state = bandit(2_500, values=values, replay=Replay(3_000, 100, 64, 4), entropy_target=target)
    assert float(state.policy.deviation[0]) == pytest.approx(wanted, abs=0.06)
    # where s is best, 2 s² = α: the square counts −1, and a nat of log s counts α
    assert float(jnp.exp(state.entropy.log_coefficient)) == pytest.approx(2 * wanted**2, abs=0.12)


@pytest.mark.ci
def test_nothing_moves_before_there_is_enough_experience():
    parts = {"values": ActionValueEnsemble(network=Bowls()), "replay": Replay(500, 61, 8, 2)}
    before, after = (bandit(decisions, **parts) for decisions in (28, 36))  # two observations a decision
    np.testing.assert_array_equal(before.policy.weights, unit().weights)
    assert float(after.policy.weights[0, 0]) != 0.2


# -- what it takes


def test_parts_and_policies_without_a_place_in_it_are_refused():
    for changes, words in (
        ({"update_every": "episode"}, "update_every = 'episode': must be an integer of at least 1"),
        ({"entropy": 0.1, "entropy_target": EntropyTarget()}, r"entropy = 0\.1: must be None with an entropy_target"),
    ):
        with pytest.raises(ValueError, match=words):
            SoftActorCritic(unit(), **changes)
    with pytest.raises(ValueError, match="start = 200: must be at most capacity = 100"):
        Replay(100, 200)
    with pytest.raises(ValueError, match=r"share = 1\.5: must be in \[0, 1\]"):
        Hindsight(1.5)
    with pytest.raises(ValueError, match="policy = 'Hyperplanes': must be one with real-valued actions"):
        SoftActorCritic(Hyperplanes(jnp.zeros((2, 1)), jnp.zeros(2))).init(jax.random.key(0))
    with pytest.raises(ValueError, match="policy = '65 alternatives': must be of at most 64 alternatives"):
        SoftActorCritic(Softmax(jnp.zeros((65, 1)))).init(jax.random.key(0))
    with pytest.raises(ValueError, match="policy = 'Softmax': must be one with real-valued actions"):
        TwinDelayed(Softmax(jnp.zeros((2, 1)))).init(jax.random.key(0))
    with pytest.raises(ValueError, match="policy = 'BoundedHyperplanes': must be one whose actions JAX"):
        SoftActorCritic(bounded_hyperplanes(3, 2, density="beta")).init(jax.random.key(0))
    for changes, words in (
        ({"optimizer": "conjugate-ascent"}, "optimizer = 'ConjugateAscent': must be one that makes a step of every"),
        ({"metric": "lstd-nac"}, "unknown setting of agent 'metric'"),
        ({"baseline": "mean"}, "unknown setting of agent 'baseline'"),
        ({"estimator": "olgarb"}, "unknown setting of agent 'estimator'"),
    ):
        with pytest.raises(ValueError, match=words):
            mg.agent_for(arm(), changes, preset="sac")
    with pytest.raises(ValueError, match="envs = 2: must be 1 for the experience kept by SoftActorCritic"):
        mg.train(arm(), preset_for(arm()), 100, envs=2, progress=False)


def preset_for(task, **changes):
    small = {
        "policy.network": SMALL,
        "values.network": SMALL,
        "replay.start": 40,
        "replay.batch": 8,
        "replay.updates": 2,
        **changes,
    }
    return mg.agent_for(task, small, preset="sac", steps=400)


@pytest.mark.ci
def test_td3_averages_the_last_eighth_of_its_steps():
    """No step is made before there is enough experience."""
    small = {"policy.network": SMALL, "values.network": SMALL, "replay.batch": 8}
    agent = mg.agent_for(arm(), small, preset="td3", steps=1_600)
    stepper = stepper_for(arm(), agent, [0])
    stepper.advance(1_600)
    made = int(stepper.state["cycle"].agent.steps[0])
    assert (made - agent.averaging.start) / made == pytest.approx(1_600 / 8 / (1_600 - 1_000), abs=0.1)
    assert mg.agent_for(arm(), preset="td3", steps=500).averaging.start == 0


@pytest.mark.ci
def test_a_stopped_run_continues_bit_for_bit_with_its_experience(tmp_path):
    task = arm()
    agent = preset_for(task)
    whole = mg.train(task, agent, 400, [0, 1], window=100, progress=False)
    mg.train(task, agent, 200, [0, 1], tmp_path / "part", window=100, progress=False)
    again = mg.resume(tmp_path / "part", steps=400, progress=False)
    for one, other in zip(jax.tree.leaves(whole.policies), jax.tree.leaves(again.policies), strict=True):
        np.testing.assert_array_equal(one, other)
    assert np.ptp(whole.policies.pool.weights) > 0  # it has learned


@pytest.mark.slow
def test_seeds_learn_as_if_alone_but_for_rounding():
    task = arm()
    both, alone = (mg.train(task, preset_for(task), 400, seeds, progress=False) for seeds in ([0, 1], [1]))
    for one, other in zip(jax.tree.leaves(both.policies), jax.tree.leaves(alone.policies), strict=True):
        np.testing.assert_allclose(one[1], other[0], rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"optimizer": ConjugateAscent()}, "optimizer = 'ConjugateAscent': must be one that makes a step"),
        ({"transformations": (FisherMetric(),)}, r"transformations\.0 = 'FisherMetric': must be one that reads"),
    ],
)
def test_transformations_that_would_have_no_effect_are_refused(changes, told):
    with pytest.raises(ValueError, match=told):
        SoftActorCritic(unit(), **changes)
