"""Linear critics: against exact values, the textbook recursion, and the exact gradients that they lead to."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, started, told
from scipy.special import softmax

from motorgrad.learning import (
    SGD,
    Agent,
    CriticStep,
    Estimator,
    Exponential,
    Features,
    LeastSquares,
    LinearCritic,
    Part,
    SparseLearner,
    TemporalDifference,
    Transition,
    TrueOnlineTemporalDifference,
    gae,
)
from motorgrad.policies import Hyperplanes, LocalGaussians, Softmax
from motorgrad.tasks import CallAdmission, Chain, ThreeState
from motorgrad.training import agent_for, stepper_for
from motorgrad.worlds import FiniteMDP, oracle
from motorgrad.worlds.oracle import critic_gradient, flat, values

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
CHAIN_POINT = Softmax(np.array([[0.3, -0.2, 0.1, 0.0], [0.0, 0.4, 0.2, 0.0]]))
CALLS = CallAdmission(capacity=3)


class Which(Part):
    """Features that tell the states of an MDP apart: 1 for the one that looks like what is seen."""

    mdp: FiniteMDP = eqx.field(static=True)

    def __call__(self, observation, previous):
        apart = jnp.sum(jnp.abs(jnp.asarray(self.mdp.observations, observation.dtype) - observation), axis=1)
        return (apart < 1e-5).astype(observation.dtype)


TASKS = {"three states": (ThreeState(), POINT), "chain": (Chain(length=4), CHAIN_POINT)}
FITS = {
    "least squares": LeastSquares(rate=0.0, damping=1e-6, interval=50),
    "temporal differences": TemporalDifference(0.01, level_rate=0.0),
}


def with_weights(state, weights):
    """The state of a learner with other weights of its critic."""
    critic = state.estimator.baseline._replace(weights=weights)
    return state._replace(estimator=state.estimator._replace(baseline=critic))


def learned(task, policy, critic, decisions, seeds=40):
    """The critics of many seeds at a fixed policy."""
    stepper = stepper_for(task, Agent(policy, Estimator(Exponential(0.5), critic, update_every="never")), range(seeds))
    stepper.advance(decisions)
    return stepper.state["cycle"].agent


def check_exact(weights, exact, centred, tolerance):
    """The mean of many critics is the exact one, but for a constant where values are differential."""
    weights = weights - weights.mean(1, keepdims=True) if centred else weights
    exact = exact - exact.mean() if centred else exact
    spread = weights.std(0) / np.sqrt(len(weights))
    scale = np.abs(exact).max()
    assert spread.max() < 0.05 * scale  # sharp enough for a bias to show
    np.testing.assert_array_less(np.abs(weights.mean(0) - exact), 4 * spread + tolerance * scale)


@pytest.mark.slow
@pytest.mark.parametrize("discount", [None, pytest.param(0.8, marks=pytest.mark.ci)])
@pytest.mark.parametrize("decay", [pytest.param(0.0, marks=pytest.mark.slow), 0.7])
@pytest.mark.parametrize("fit", [pytest.param(fit, marks=[pytest.mark.ci] * (fit == "least squares")) for fit in FITS])
@pytest.mark.parametrize("name", TASKS)
def test_a_critic_that_tells_states_apart_learns_the_exact_values(name, fit, decay, discount):
    task, policy = TASKS[name]
    critic = LinearCritic(Which(task.dynamics), discount, decay, FITS[fit])
    seeds = 400 if isinstance(critic.fit, TemporalDifference) else 40  # the noisier one
    weights = np.asarray(learned(task, policy, critic, 20_000, seeds).estimator.baseline.weights, float)
    check_exact(weights, values(task.dynamics, policy, discount), discount is None, 0.01)


@pytest.mark.ci
def test_inputs_and_a_constant_tell_three_states_apart():
    critic = LinearCritic(Features(), 0.8, 0.5, LeastSquares(0.0, damping=1e-7, interval=100))
    weights = np.asarray(learned(ThreeState(), POINT, critic, 20_000).estimator.baseline.weights, float)
    seen = np.c_[ThreeState().dynamics.observations, np.ones(3)]
    check_exact(weights @ seen.T, values(ThreeState().dynamics, POINT, 0.8), False, 0.01)


@pytest.mark.ci
@pytest.mark.parametrize("fit", FITS)
def test_a_critic_that_cannot_tell_states_apart_ends_at_the_fixed_point(fit):
    """Of 80 states it sees 16: the weights are those of Tsitsiklis and Van Roy (1997), whose error is not 0."""
    mdp, policy = CALLS.dynamics, Hyperplanes(np.full((1, CALLS.observation_size), 0.5), np.zeros(1))
    discount, decay = 0.9, 0.5
    pay = np.einsum("sa,as->s", oracle.action_probabilities(mdp, policy), mdp.expected_rewards)
    matrix, pi = oracle.transition_matrix(mdp, policy), oracle.stationary_distribution(mdp, policy)
    seen = np.c_[mdp.observations, np.ones(mdp.states)]
    later = seen.T @ np.diag(pi) @ np.linalg.inv(np.eye(mdp.states) - discount * decay * matrix)
    wanted = np.linalg.solve(later @ (seen - discount * matrix @ seen), later @ pay)
    assert np.abs(seen @ wanted - values(mdp, policy, discount)).max() > 0.1
    critic = LinearCritic(Features(), discount, decay, FITS[fit])
    check_exact(
        np.asarray(learned(CALLS, policy, critic, 20_000).estimator.baseline.weights, float), wanted, False, 0.02
    )


def test_the_exact_values_solve_their_equations():
    mdp = ThreeState().dynamics
    matrix, pi = oracle.transition_matrix(mdp, POINT), oracle.stationary_distribution(mdp, POINT)
    v, eta = values(mdp, POINT), oracle.average_reward(mdp, POINT)
    pay = np.einsum("sa,as->s", oracle.action_probabilities(mdp, POINT), mdp.expected_rewards)
    np.testing.assert_allclose(v, pay - eta + matrix @ v, atol=1e-12)
    assert pi @ v == pytest.approx(0, abs=1e-12)
    assert values(mdp, POINT, 0.9)[mdp.start] == pytest.approx(oracle.discounted_return(mdp, POINT, 0.9), abs=1e-12)
    with pytest.raises(ValueError, match="discount = 1"):
        values(mdp, POINT, 1.0)


@pytest.mark.parametrize("decay", [0.0, 0.5, 0.95])
def test_with_exact_values_every_trace_leads_to_the_exact_gradient(decay):
    mdp = ThreeState().dynamics
    exact = flat(critic_gradient(mdp, POINT, values(mdp, POINT), decay))
    np.testing.assert_allclose(exact, flat(oracle.gradient(mdp, POINT)), atol=1e-12)
    discounted = flat(critic_gradient(mdp, POINT, values(mdp, POINT, 0.9), decay, 0.9))
    np.testing.assert_allclose(discounted, flat(oracle.biased_gradient(mdp, POINT, 0.9)), atol=1e-12)


def test_a_trace_of_the_discount_forgives_any_critic():
    mdp, wrong = ThreeState().dynamics, np.array([3.0, -1.0, 0.5])
    forgiven = flat(critic_gradient(mdp, POINT, wrong, 0.9, 0.9))
    np.testing.assert_allclose(forgiven, flat(oracle.biased_gradient(mdp, POINT, 0.9)), atol=1e-12)


# (critic's weights by state, λ): with γ = .8, what generalised advantages estimate
ADVANTAGES = {
    "right, λ = 0": (None, 0.0),
    "wrong, λ = ½": ([1.0, -1.0, 0.5], 0.5),
    "wrong, λ = 1": ([1.0, -1.0, 0.5], 1.0),
}


@pytest.mark.representatives("right, \\u03bb = 0")
@pytest.mark.parametrize("name", ADVANTAGES)
def test_samples_with_a_given_critic_average_to_the_exact_expression(name):
    mdp, (given, decay) = ThreeState().dynamics, ADVANTAGES[name]
    exact = values(mdp, POINT, 0.8)
    given = exact if given is None else np.array(given)
    critic = LinearCritic(Which(mdp), 0.8, 0.0, TemporalDifference(0.0))
    stepper = stepper_for(ThreeState(), Agent(POINT, gae(critic, decay, "never")), range(400))
    state = stepper.state
    agent = state["cycle"].agent
    weights = np.tile(np.float32(given), (400, 1))
    agent = with_weights(agent, weights)
    stepper.restore({**state, "cycle": state["cycle"]._replace(agent=agent)})
    stepper.advance(4_800)
    found = np.asarray(stepper.state["cycle"].agent.gradient.mean.weights, float).reshape(400, -1)
    wanted = flat(critic_gradient(mdp, POINT, given, 0.8 * decay, 0.8))
    error = found.std(0) / 20
    assert np.linalg.norm(error) < 0.05 * np.linalg.norm(wanted)
    np.testing.assert_array_less(np.abs(found.mean(0) - wanted), 4 * error + 2e-3 * np.linalg.norm(wanted))
    biased = flat(oracle.biased_gradient(mdp, POINT, 0.8))
    off = np.linalg.norm(wanted - biased) / np.linalg.norm(biased)
    assert (off > 0.1) == (name == "wrong, λ = ½")  # the bias is there to be seen, or is none


@pytest.mark.ci
def test_a_learned_critic_makes_the_estimate_without_a_trace_exact():
    task, mdp = Chain(length=4), Chain(length=4).dynamics
    critic = LinearCritic(Which(mdp), None, 0.0, LeastSquares(0.0, damping=1e-6, interval=20))
    stepper = stepper_for(task, Agent(CHAIN_POINT, gae(critic, 0.0, "never")), range(400))
    stepper.advance(4_800)
    found = np.asarray(stepper.state["cycle"].agent.gradient.mean.weights, float).reshape(400, -1)
    exact = flat(oracle.gradient(mdp, CHAIN_POINT))
    error = found.std(0) / 20
    assert np.linalg.norm(error) < 0.05 * np.linalg.norm(exact)
    # 2 % for what the critic did not know at first
    np.testing.assert_array_less(np.abs(found.mean(0) - exact), 4 * error + 0.02 * np.linalg.norm(exact))
    plain = flat(oracle.biased_gradient(mdp, CHAIN_POINT, 0.0))
    assert np.linalg.norm(plain - exact) > 0.8 * np.linalg.norm(exact)  # as it would be without a critic


def follow(critic, policy, steps, dtype=np.float64):
    """A critic after decisions (observation, action, reward, next observation, terminated), and its errors."""
    states, errors = followed(critic, policy, steps, dtype)
    return jax.tree.map(lambda leaf: leaf[-1], states), errors.tolist()


def followed(critic, policy, steps, dtype=np.float64):
    """A critic after each of these decisions, and its errors."""
    with jax.enable_x64(True):

        @jax.jit
        def whole(told):
            def decide(state, now):
                now = Transition(*now)
                advantage, state = critic.update(critic.observe(state, now.observation), policy, now)
                state = critic.solve(state)
                return state, (state, advantage.value)

            return jax.lax.scan(decide, critic.init(policy, dtype), told)[1]

        told = tuple(np.array(part) for part in zip(*steps, strict=True))
        return jax.tree.map(np.asarray, whole(told))


def random_steps(count, inputs=2):
    rng = np.random.default_rng(0)
    seen, rewards = rng.normal(size=(100, inputs)), rng.normal(size=100)
    return [(seen[t], t % 2, rewards[t], seen[t + 1], False) for t in range(count)]


# features from which decisions are gathered as rows
@pytest.mark.parametrize("many", [100, pytest.param(1, marks=pytest.mark.ci)])
def test_least_squares_are_those_of_the_recursion_by_rank_one_updates(many, monkeypatch):
    monkeypatch.setattr("motorgrad.learning._critic_fits.MANY_FEATURES", many)
    discount, decay, initial = 0.9, 0.6, 2.0
    critic = LinearCritic(Features(), discount, decay, LeastSquares(0.0, initial, 0.0, interval=1))
    steps = random_steps(30)
    state, errors = follow(critic, POINT, steps)
    inverse, weights, trace = np.eye(3) / initial, np.zeros(3), np.zeros(3)
    for (y, _, reward, after, _), error in zip(steps, errors, strict=True):
        change = np.append(y, 1) - discount * np.append(after, 1)
        trace = discount * decay * trace + np.append(y, 1)
        surprise = reward - change @ weights
        assert surprise == pytest.approx(error, abs=1e-9)
        gain = inverse @ trace / (1 + change @ inverse @ trace)
        weights = weights + gain * surprise
        inverse = inverse - np.outer(gain, change @ inverse)
    np.testing.assert_allclose(state.weights, weights, atol=1e-9)


@pytest.mark.ci
def test_least_squares_forget_by_their_rate():
    critic = LinearCritic(Features(bias=False), 0.5, 0.0, LeastSquares(0.5, 1.0, 0.0, interval=1))
    state, _ = follow(critic, POINT, steps := random_steps(6))
    matrix, pay = np.eye(2), np.zeros(2)
    for y, _, reward, after, _ in steps:  # max(1/(n + 1), ½) = ½ throughout
        matrix, pay = (matrix + np.outer(y, y - 0.5 * after)) / 2, (pay + y * reward) / 2
    np.testing.assert_allclose(state.weights, np.linalg.solve(matrix, pay), atol=1e-9)


def test_the_interval_is_when_the_weights_move():
    critic = LinearCritic(Features(), 0.5, 0.0, LeastSquares(interval=4))
    third, fourth, *_, seventh, eighth = followed(critic, POINT, random_steps(8))[0].weights[2:]
    assert not third.any()
    assert fourth.any()
    np.testing.assert_array_equal(fourth, seventh)
    assert not np.array_equal(seventh, eighth)


@pytest.mark.ci
def test_rows_and_sums_of_an_interval_are_the_same(monkeypatch):
    critic = LinearCritic(Features(), 0.9, 0.6, LeastSquares(0.1, 1.0, 0.0, interval=4))
    found = []
    for many in (100, 1):
        monkeypatch.setattr("motorgrad.learning._critic_fits.MANY_FEATURES", many)
        found.append(follow(critic, POINT, random_steps(14))[0].weights)
    np.testing.assert_allclose(*found, rtol=1e-9)
    assert np.abs(found[0]).max() > 0.1


def test_temporal_differences_are_suttons():
    rate, decay = 0.1, 0.6
    critic = LinearCritic(Features(), None, decay, TemporalDifference(rate, 0.0))
    state, errors = follow(critic, POINT, steps := random_steps(10))
    weights, trace, rewards = np.zeros(3), np.zeros(3), [0.0]
    for (y, _, reward, after, _), error in zip(steps, errors, strict=True):
        trace = decay * trace + np.append(y, 1)
        surprise = reward - np.mean(rewards) + weights @ np.append(after, 1) - weights @ np.append(y, 1)
        assert surprise == pytest.approx(error, abs=1e-12)
        weights, rewards = weights + rate * surprise * trace, [*(rewards if rewards != [0.0] else []), reward]
    np.testing.assert_allclose(state.weights, weights, atol=1e-12)


def test_a_terminated_state_is_worth_nothing_and_a_truncated_one_what_the_critic_says():
    critic = LinearCritic(Features(), 0.9, 0.5, TemporalDifference(0.0))
    agent = Agent(POINT, Estimator(Exponential(0.5), critic))
    state = with_weights(started(agent), jnp.array([1.0, 2.0, 3.0]))
    after = np.array([1.0, -1.0])
    worth = {}
    for name, flags in {"goes on": {}, "terminated": {"terminated": True}, "truncated": {"truncated": True}}.items():
        acted, _, ended = told(agent, state, [0.5, 0.25], [0.3], 1.0, after, **flags)
        score = np.asarray(acted.estimator.trace.weights)
        worth[name] = float(np.sum(np.asarray(ended.gradient.weights) * score) / np.sum(score**2))
        over = name != "goes on"
        critic_state = ended.estimator.baseline
        for kept in (critic_state.fit, critic_state.previous, ended.estimator.trace.weights):
            assert (np.abs(kept).max() == 0) == over
    assert worth["goes on"] == worth["truncated"] == pytest.approx(1 + 0.9 * 2 - 4, abs=1e-6)
    assert worth["terminated"] == pytest.approx(1 - 4, abs=1e-6)


@pytest.mark.parametrize("many", [100, 1])
def test_a_diverged_sample_teaches_nothing(many, monkeypatch):
    monkeypatch.setattr("motorgrad.learning._critic_fits.MANY_FEATURES", many)
    for fit in (TemporalDifference(0.1), LeastSquares(interval=1)):
        agent = Agent(POINT, gae(LinearCritic(Features(), 0.9, 0.5, fit), 0.9, 10))
        lost = decided(agent, started(agent), [0.5, 0.25], [0.3], np.nan, [np.nan, np.nan], diverged=True)
        after, fresh = lost.state, eqx.filter_jit(agent.restart)(lost.acted)
        jax.tree.map(
            np.testing.assert_array_equal,
            (after.estimator.baseline, after.gradient),
            (fresh.estimator.baseline, fresh.gradient),
        )


def test_the_previous_action_is_seen():
    critic = LinearCritic(Features(squares=True, actions=True), 0.9, 0.5, TemporalDifference(0.0))
    policy = Hyperplanes(np.zeros((3, 2)), np.zeros(3))
    agent = Agent(policy, gae(critic))
    state = started(agent)
    assert state.estimator.baseline.weights.shape == (2 + 2 + 3 + 1,)
    acted, action, _, state = decided(agent, state, [0.5, 2.0], [0.1, 0.9, 0.2], 0.0, [3.0, 1.0])
    np.testing.assert_array_equal(action, [1, 0, 1])
    np.testing.assert_array_equal(acted.estimator.baseline.features, [0.5, 2.0, 0.25, 4.0, 0, 0, 0, 1])
    acted = decided(agent, state, [3.0, 1.0], np.zeros(3), 0.0).acted
    np.testing.assert_array_equal(acted.estimator.baseline.features, [3, 1, 9, 1, 1, 0, 1, 1])
    discrete = LinearCritic(Features(actions=True, bias=False)).init(POINT, jnp.float32)
    assert discrete.weights.shape == (2 + 2,)


def test_generalised_advantages_are_their_sum():
    total, discount, decay = 0.0, 0.9, 0.7
    critic = LinearCritic(Features(), discount, 0.0, TemporalDifference(0.0))
    agent = Agent(POINT, gae(critic, decay, "never"))
    with jax.enable_x64(True):
        agent = dataclasses.replace(agent, policy=Softmax(jnp.asarray([[1.0, 1.0], [-1.0, -1.0]], jnp.float64)))
        given = np.array([1.0, -2.0, 0.5])
        state = with_weights(started(agent), given)
        rng, seen, scores, errors = np.random.default_rng(1), [], [], []
        y = rng.normal(size=2)
        for _ in range(6):
            after, reward = rng.normal(size=2), rng.normal()
            _, action, state = told(agent, state, y, rng.random(2)[:1], reward, after)
            chance = softmax(np.array([[1.0, 1.0], [-1.0, -1.0]]) @ y)
            scores.append(np.outer((np.arange(2) == int(action)) - chance, y))
            errors.append(reward + discount * given @ np.append(after, 1) - given @ np.append(y, 1))
            seen.append(y)
            y = after
        for t, score in enumerate(scores):
            total += score * sum((discount * decay) ** k * error for k, error in enumerate(errors[t:]))
        np.testing.assert_allclose(state.gradient.mean.weights, total / 6, atol=1e-10)


def test_true_online_weights_are_those_of_the_online_forward_view():
    """After every decision each earlier state has moved to its λ-return up to now (van Seijen et al., 2016, eq. 5)."""
    rate, discount, decay, steps = 0.3, 0.9, 0.8, 7
    rng = np.random.default_rng(2)
    features, rewards = rng.normal(size=(steps + 1, 3)), rng.normal(size=steps)
    fit, forward = TrueOnlineTemporalDifference(rate), [np.zeros(3)]
    with jax.enable_x64(True):
        weights, state, update = jnp.zeros(3), fit.init(jnp.zeros(3), 3), jax.jit(fit.update)
        for now in range(1, steps + 1):
            phi, after = features[now - 1], features[now]
            error = rewards[now - 1] + discount * np.asarray(weights) @ after - np.asarray(weights) @ phi
            step = CriticStep(phi, after, rewards[now - 1], np.zeros(()), error, discount, decay)
            weights, state = update(weights, state, step)
            moved = np.zeros(3)
            for k in range(now):
                n_step = [
                    rewards[k : k + n] @ discount ** np.arange(n) + discount**n * forward[k + n - 1] @ features[k + n]
                    for n in range(1, now - k + 1)
                ]
                target = (1 - decay) * sum(decay**n * g for n, g in enumerate(n_step[:-1]))
                target += decay ** (len(n_step) - 1) * n_step[-1]
                moved = moved + rate * (target - moved @ features[k]) * features[k]
            forward.append(moved)
            np.testing.assert_allclose(weights, moved, atol=1e-12)
        kept = update(weights, state, step, np.bool_(True))
        jax.tree.map(np.testing.assert_array_equal, kept, (weights, state))


def critic_table(**fit):
    return {"kind": "critic", "fit": {"kind": "td", **fit}}


@pytest.mark.ci
def test_a_learner_with_a_critic_finds_the_best_policy():
    critic = LinearCritic(Features(), None, 0.5, LeastSquares(1e-3, interval=50))
    agent = Agent(Softmax(jnp.zeros((2, 2))), gae(critic, 0.5, 50), SGD(0.5))
    stepper = stepper_for(ThreeState(), agent, range(10))
    stepper.advance(500_000)
    earned = [oracle.average_reward(ThreeState().dynamics, Softmax(w)) for w in stepper.policies().weights]
    assert min(earned) >= 0.799


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: LinearCritic(discount=1.5), "discount = 1.5: must be None or in"),
        (lambda: LinearCritic(decay=-0.1), "decay = -0.1: must be in"),
        (lambda: LinearCritic(features=lambda y, a: y), "features = .*: must be a Part that can be called"),
        (lambda: LinearCritic(fit="td"), "fit = 'td': must be a CriticFit"),
        (lambda: TemporalDifference(-1.0), "rate = -1.0: must be a finite number of at least 0"),
        (lambda: TemporalDifference(level_rate=2.0), "level_rate = 2.0"),
        (lambda: LeastSquares(rate=2.0), "rate = 2.0"),
        (lambda: LeastSquares(initial=0.0), "initial = 0.0"),
        (lambda: LeastSquares(damping=-1.0), "damping = -1.0"),
        (lambda: LeastSquares(interval=0), "interval = 0"),
        (lambda: gae(LinearCritic(), 1.5), "decay = 1.5"),
        (
            lambda: SparseLearner(LocalGaussians([[0.5]], [[0.0]]), baseline=LinearCritic()),
            "baseline = .*: must be None or a ScalarBaseline",
        ),
        (
            lambda: agent_for("three-state", baseline=critic_table(learning_rate=-1.0)),
            "baseline.fit.learning_rate = -1.0",
        ),
        (
            lambda: agent_for("three-state", {"baseline": "mean", "estimator.baseline.fit": "td"}),
            "unknown setting of .*baseline 'fit'",
        ),
        (lambda: agent_for("three-state", baseline={"kind": "critic", "decay": "a"}), "baseline.decay = 'a'"),
        (lambda: agent_for("three-state", baseline={"kind": "critic", "fit": "tdd"}), "did you mean 'td'"),
        (
            lambda: stepper_for(ThreeState(), Agent(POINT, gae(LinearCritic(discount=1.0), 0.5)), [0]),
            r"estimator\.baseline\.discount = 1: needs episodes",
        ),
    ],
)
def test_what_is_impossible_is_refused_by_name(make, said):
    with pytest.raises(ValueError, match=said):
        make()
