"""The exact oracle: against finite differences, limits, brute force, and the published figures."""

import itertools
from fractions import Fraction

import equinox as eqx
import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jax.flatten_util import ravel_pytree

from motorgrad.policies import Factored, Hyperplanes, LocalGaussians, Softmax, split
from motorgrad.worlds import AdmissionThresholds, FiniteMDP, call_admission, chain, oracle, three_state
from motorgrad.worlds._chains import evaluate, stationary
from motorgrad.worlds.oracle import to_float64

few = settings(max_examples=10, deadline=None, derandomize=True)
seeds = st.integers(0, 2**31)
POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point


def random_mdp(seed, states=4, actions=3, inputs=3):
    rng = np.random.default_rng(seed)
    transitions = rng.dirichlet(np.full(states, 0.7), (actions, states)) + 0.02
    transitions /= transitions.sum(-1, keepdims=True)
    transitions /= transitions.sum(-1, keepdims=True)
    shape = (states,) if rng.random() < 0.5 else (actions, states)
    start = int(rng.integers(states))
    return FiniteMDP(transitions, rng.normal(size=shape), rng.normal(size=(states, inputs)), start)


def softmax(rng, actions=3, inputs=3):
    return Softmax(rng.normal(size=(actions, inputs)).astype(np.float32))


def factored(rng):
    local = LocalGaussians(rng.normal(size=(1, 3)), rng.normal(size=(1, 3)), 0.9)
    return Factored([Hyperplanes(rng.normal(size=(1, 3)), rng.normal(size=1)), local])


POLICIES = {"softmax on three actions": (softmax, 3), "two units on four actions": (factored, 4)}


def slope(function, policy, direction, step=1e-5):
    """The two-sided difference of `function` along `direction` in the trainable parameters."""
    with jax.enable_x64(True):
        theta, rest = split(to_float64(policy))
        vector, build = ravel_pytree(theta)
        up, down = (function(eqx.combine(build(vector + s * step * direction), rest)) for s in (1, -1))
    return (up - down) / (2 * step)


def check_slope(function, policy, gradient, seed, atol):
    vector = oracle.flat(gradient)
    direction = np.random.default_rng(seed).normal(size=len(vector))
    # error of the two-sided difference: step² = 1e-10 of the third derivative, plus rounding 1e-16 / 1e-5
    assert vector @ direction == pytest.approx(slope(function, policy, direction), rel=1e-6, abs=atol)


@pytest.mark.representatives("softmax on three actions")
@pytest.mark.parametrize("kind", POLICIES)
@few
@given(seed=seeds)
def test_the_gradient_is_the_slope_of_the_average_reward(kind, seed):
    make, actions = POLICIES[kind]
    mdp, policy = random_mdp(seed, actions=actions), make(np.random.default_rng(seed + 1))
    check_slope(lambda p: oracle.average_reward(mdp, p), policy, oracle.gradient(mdp, policy), seed, 1e-8)


@pytest.mark.representatives("softmax on three actions")
@pytest.mark.parametrize("kind", POLICIES)
@few
@given(seed=seeds, discount=st.floats(0, 0.95))
def test_the_discounted_gradient_is_the_slope_of_the_discounted_return(kind, seed, discount):
    make, actions = POLICIES[kind]
    mdp, policy = random_mdp(seed, actions=actions), make(np.random.default_rng(seed + 1))
    exact = oracle.discounted_gradient(mdp, policy, discount)
    # returns are up to twenty times larger than average rewards
    check_slope(lambda p: oracle.discounted_return(mdp, p, discount), policy, exact, seed, 1e-7)


@few
@given(seed=seeds)
def test_the_biased_gradient_tends_to_the_gradient(seed):
    mdp, policy = random_mdp(seed), softmax(np.random.default_rng(seed + 1))
    exact = oracle.flat(oracle.gradient(mdp, policy))
    off = [np.abs(oracle.flat(oracle.biased_gradient(mdp, policy, 1 - gap)) - exact).max() for gap in (1e-4, 1e-6)]
    assert off[1] < 1e-5
    assert off[1] < 0.02 * off[0] + 1e-9  # the bias falls in proportion to 1 − β; 1e-9 for the solver near β = 1


@few
@given(seed=seeds)
def test_the_discounted_return_is_the_sum_over_time(seed):
    mdp, policy = random_mdp(seed), softmax(np.random.default_rng(seed + 1))
    matrix, total = oracle.transition_matrix(mdp, policy), 0.0
    mean = np.einsum("sa,as->s", oracle.action_probabilities(mdp, policy), mdp.expected_rewards)
    where = np.eye(mdp.states)[mdp.start]
    for t in range(200):
        total += 0.8**t * where @ mean
        where = where @ matrix
    assert oracle.discounted_return(mdp, policy, 0.8) == pytest.approx(total, abs=1e-12)  # 0.8^200 = 4e-20


@few
@given(seed=seeds)
def test_the_stationary_distribution_stays(seed):
    mdp, policy = random_mdp(seed), softmax(np.random.default_rng(seed + 1))
    pi = oracle.stationary_distribution(mdp, policy)
    np.testing.assert_allclose(pi @ oracle.transition_matrix(mdp, policy), pi, atol=1e-14)
    assert pi.sum() == pytest.approx(1, abs=1e-14)
    assert (pi > 0).all()


@few
@given(seed=seeds)
def test_policy_iteration_finds_what_trying_every_policy_finds(seed):
    mdp = random_mdp(seed, states=4, actions=3)
    every, best = np.arange(mdp.states), -np.inf
    for choice in itertools.product(range(mdp.actions), repeat=mdp.states):
        pi = stationary(mdp.transitions[choice, every])
        best = max(best, pi @ mdp.expected_rewards[choice, every])
    choice, eta = oracle.optimal_policy(mdp)
    assert eta == oracle.average_reward(mdp, choice)
    assert eta == pytest.approx(best, abs=1e-14)


def exact_average(matrix, rewards):
    """The average reward of an irreducible chain, in fractions: what leaves a state is balanced by what enters it."""
    states = range(len(matrix))
    flow = [[Fraction(x) for x in row] for row in matrix]
    rows = [[flow[j][i] if i != j else -sum(flow[i][k] for k in states if k != i) for j in states] for i in states]
    system = [*([*row, Fraction(0)] for row in rows[1:]), [Fraction(1)] * (len(matrix) + 1)]
    for i in states:
        pivot = next(k for k in range(i, len(system)) if system[k][i])
        system[i], system[pivot] = system[pivot], system[i]
        system[i] = [x / system[i][i] for x in system[i]]
        for k in states:
            if k != i:
                system[k] = [x - system[k][i] * y for x, y in zip(system[k], system[i], strict=True)]
    return sum(system[i][-1] * Fraction(rewards[i]) for i in states)


def slow_mdp(seed, states=4, actions=2):
    """An MDP whose states are left between once in a few decisions and once in 10⁸."""
    rng = np.random.default_rng(seed)
    moves = rng.dirichlet(np.full(states, 0.7), (actions, states)) * 0.96 + 0.01
    moves *= 10.0 ** -rng.integers(0, 9, (actions, states, 1)) * (1 - np.eye(states))
    return FiniteMDP(
        moves + (1 - moves.sum(-1))[..., None] * np.eye(states), rng.normal(size=(actions, states)), moves[0]
    )


@pytest.mark.parametrize(
    "seed", [3, 256, 265, 287]
)  # of the latter three a tolerance of 1e-12 of the values misses the best
def test_the_best_of_slow_states_is_exact_to_the_last_digit(seed):
    mdp = slow_mdp(seed)
    every = np.arange(mdp.states)

    def exact(table):
        return exact_average(mdp.transitions[table, every].tolist(), mdp.rewards[table, every].tolist())

    choice, eta = oracle.optimal_policy(mdp)
    best = max(exact(np.array(table)) for table in itertools.product(range(mdp.actions), repeat=mdp.states))
    assert exact(choice) == best
    assert abs(Fraction(eta) - best) < 2e-15


def test_states_that_change_once_in_ten_thousand_decisions_hide_nothing():
    hold, leave = np.eye(2), np.array([[1 - 1e-4, 1e-4], [1e-4, 1 - 1e-4]])
    mdp = FiniteMDP([hold, leave], [[0.5, 0.75], [0.5, 0.0]], np.eye(2))
    assert oracle.optimal_policy(mdp)[1] == pytest.approx(0.75, abs=1e-15)
    assert oracle.optimal_policy(mdp)[0].tolist() == [1, 0]


def cycle_average(successor, rewards, state):
    """The average of the cycle that a deterministic chain ends in."""
    path = []
    while state not in path:
        path.append(state)
        state = successor[state]
    cycle = path[path.index(state) :]
    return sum(Fraction(rewards[each]) for each in cycle) / len(cycle)


@few
@given(seed=seeds)
def test_the_best_of_several_recurrent_classes_is_the_best_from_every_state(seed):
    rng = np.random.default_rng(seed)
    states, actions = 5, 2
    successors, rewards = rng.integers(0, states, (actions, states)), rng.integers(-3, 4, (actions, states)) / 7
    mdp = FiniteMDP(np.eye(states)[successors], rewards, np.eye(states), start=int(rng.integers(states)))
    every = np.arange(states)

    def averages(table):
        return [cycle_average(successors[table, every], rewards[table, every], state) for state in every]

    tables = map(np.array, itertools.product(range(actions), repeat=states))
    best = [float(max(column)) for column in zip(*map(averages, tables), strict=True)]
    choice, eta = oracle.optimal_policy(mdp)
    np.testing.assert_allclose([float(each) for each in averages(choice)], best, atol=1e-15)
    assert eta == pytest.approx(best[mdp.start], abs=1e-15)
    assert eta == oracle.average_reward(mdp, choice)


def test_the_average_of_a_table_is_that_of_the_policy_that_follows_it():
    mdp = random_mdp(5)
    table = [2, 0, 1, 1]
    follow = Softmax(1e4 * np.linalg.lstsq(np.eye(4), np.eye(3)[table], rcond=None)[0].T)
    own = FiniteMDP(mdp.transitions, mdp.rewards, np.eye(4), mdp.start)
    assert oracle.average_reward(mdp, table) == pytest.approx(oracle.average_reward(own, follow), abs=1e-14)
    for wrong, told in (
        ([0, 1], "a table of 4 integers, the action of every state"),
        ([0.0, 1.0, 0.0, 1.0], "a table of 4 integers"),
        ([0, 3, -1, 0], r"policy = \[3, -1\]: must be a table of actions from 0 to 2"),
        (None, "a policy, or a table"),
    ):
        with pytest.raises(ValueError, match=told):
            oracle.average_reward(mdp, wrong)


def test_a_table_with_several_recurrent_classes_has_the_average_from_the_start():
    mdp = FiniteMDP([np.eye(2), np.eye(2)], [0, 1], np.eye(2), start=1)
    assert oracle.average_reward(mdp, [0, 0]) == 1


def test_bits_of_a_factored_policy_are_the_mdps_actions_in_order():
    mdp, policy = random_mdp(3, actions=4), Hyperplanes(np.zeros((2, 3)), [np.log(3.0), 0.0])
    probability = oracle.action_probabilities(mdp, policy)  # first unit fires with 3/4, second with 1/2
    np.testing.assert_allclose(probability, [[0.125, 0.125, 0.375, 0.375]] * 4, rtol=1e-7)  # log 3 in float32


def test_several_recurrent_classes_are_refused():
    mdp = FiniteMDP([np.eye(2), np.eye(2)], [0, 1], np.eye(2))
    for function in (oracle.average_reward, oracle.gradient, oracle.stationary_distribution):
        with pytest.raises(ValueError, match="policy = '2 recurrent classes'"):
            function(mdp, Softmax(np.zeros((2, 2))))


def test_a_policy_over_other_actions_is_refused():
    with pytest.raises(ValueError, match="policy = '3 actions': must be over the MDP's 2 actions"):
        oracle.average_reward(three_state(), Softmax(np.zeros((3, 2))))


@pytest.mark.parametrize("function", [oracle.biased_gradient, oracle.discounted_return, oracle.discounted_gradient])
@pytest.mark.parametrize("value", [-0.1, 1.0])
def test_a_decay_or_discount_outside_its_range_is_refused(function, value):
    with pytest.raises(ValueError, match=r"(decay|discount) = .*: must be in \[0, 1\)"):
        function(three_state(), POINT, value)


# The published figures (Baxter & Bartlett, 2001); tolerances are half a unit of the last digit printed.


def test_three_state_average_reward_and_gradient_are_the_published_ones():
    mdp = three_state()
    assert oracle.average_reward(mdp, POINT) == pytest.approx(0.29419747, abs=5e-9)
    published = [-0.03272585, -0.03524847, 0.03272585, 0.03524847]
    np.testing.assert_allclose(oracle.flat(oracle.gradient(mdp, POINT)), published, atol=5e-9)


@pytest.mark.parametrize(
    ("decay", "published", "digit"),
    [
        (0, 0.0770765, 1e-7),
        (0.4, 0.0477171, 1e-7),
        (0.8, 0.0164283, 1e-7),
        (0.95, 0.0041583, 1e-7),
        (0.99, 0.00083444, 1e-8),
    ],
)
def test_three_state_relative_bias_is_the_published_one(decay, published, digit):
    exact = oracle.flat(oracle.gradient(three_state(), POINT))
    biased = oracle.flat(oracle.biased_gradient(three_state(), POINT, decay))
    assert np.linalg.norm(biased - exact) / np.linalg.norm(exact) == pytest.approx(published, abs=0.51 * digit)


def test_three_state_best_policy_always_takes_the_second_action():
    choice, eta = oracle.optimal_policy(three_state())
    np.testing.assert_array_equal(choice, [1, 1, 1])
    assert eta == pytest.approx(0.8, abs=1e-15)


@pytest.fixture(scope="module")
def admission():
    return call_admission()


@pytest.mark.representatives("1000.0-0.78")
@pytest.mark.parametrize(("threshold", "published"), [(8.0, 0.69), (1e3, 0.78)])
def test_admission_earns_what_was_published(admission, threshold, published):
    # untrained, and accepting always
    earned = oracle.average_reward(admission, AdmissionThresholds(np.full(3, threshold)))
    assert earned == pytest.approx(published, abs=0.005)


@pytest.mark.ci
def test_the_best_admission_is_no_worse_than_accepting_always_and_turns_the_cheap_calls_away(admission):
    choice, eta = oracle.optimal_policy(admission)
    assert eta > oracle.average_reward(admission, AdmissionThresholds(np.full(3, 1e3)))
    assert eta == pytest.approx(0.804657286255908, abs=2e-15)
    gain, value = evaluate(
        admission.transitions[choice, every := np.arange(admission.states)], admission.expected_rewards[choice, every]
    )
    worth = admission.expected_rewards + admission.transitions @ value  # by Bellman, no action is better
    assert (worth - gain - value).max() < 1e-12
    asked = {m: choice[admission.observations[:, m] == 1] for m in range(3)}
    shares = [asked[m].mean() for m in range(3)]
    assert shares[0] < shares[2]


@pytest.mark.ci
def test_the_admission_gradient_by_thresholds_is_a_slope():
    mdp, policy = call_admission(3), AdmissionThresholds([1.0, 2.0, 2.5])
    for seed in range(3):
        check_slope(lambda p: oracle.average_reward(mdp, p), policy, oracle.gradient(mdp, policy), seed, 1e-9)


def wait(length, variant):
    """Expected decisions from the start to the chain's end under random actions, by the equations of hitting times."""
    matrix = chain(length, variant).transitions.mean(0)[:-1, :-1]
    return np.linalg.solve(np.eye(length - 1) - matrix, np.ones(length - 1))[0]


@pytest.mark.parametrize("length", [2, 3, 6, 9])
@pytest.mark.parametrize(
    ("variant", "formula"), [("walk", lambda n: n * (n - 1)), ("reset", lambda n: 2**n - 2)], ids=["walk", "reset"]
)
def test_the_wait_for_the_chains_reward_is_the_formula(variant, formula, length):
    assert wait(length, variant) == pytest.approx(formula(length), rel=1e-10)
    random = Softmax(np.zeros((2, length)))
    # one more decision leads back to the start
    assert oracle.average_reward(chain(length, variant), random) == pytest.approx(1 / (formula(length) + 1), rel=1e-10)


@pytest.mark.parametrize("variant", ["walk", "reset"])
def test_an_episode_of_one_decision_less_than_the_chains_length_succeeds_once_in_exponentially_many(variant):
    matrix = oracle.transition_matrix(chain(6, variant), Softmax(np.zeros((2, 6))))
    reached = sum(np.linalg.matrix_power(matrix, t)[0, 5] for t in range(1, 6))
    assert reached == pytest.approx(2.0**-5, rel=1e-12)


@pytest.mark.parametrize("leaving", [1e-17, 1e-200])
def test_a_chain_that_double_precision_cannot_solve_is_refused(leaving):
    """What is left of these probabilities beside 1 is nothing: the equations of its values are singular."""
    rows = np.array([[1 - leaving, leaving], [leaving, 1 - leaving]])
    mdp, policy = FiniteMDP([rows, rows], [0.0, 1.0], np.eye(2)), Softmax(np.zeros((2, 2)))
    assert oracle.average_reward(mdp, policy) == pytest.approx(0.5)
    for function in (oracle.values, oracle.gradient, oracle.stationary_score):
        with pytest.raises(ValueError, match="policy = 'a chain whose linear equations have no unique solution'"):
            function(mdp, policy)
    with pytest.raises(ValueError, match="no unique solution"):
        oracle.best_memoryless(mdp, 1)
    with pytest.raises(ValueError, match="starts = 0: must be an integer >= 1"):
        oracle.best_memoryless(mdp, 0)
