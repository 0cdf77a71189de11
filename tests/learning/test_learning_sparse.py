"""The spatial index: what is neglected is bounded, and what is learned is what the dense learner learns."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decided, decision, refreshed, started
from hypothesis import given, settings
from hypothesis import strategies as st

from motorgrad.learning import (
    SGD,
    Agent,
    Constant,
    Episodic,
    Estimator,
    Exponential,
    Learner,
    LinearBaseline,
    MeanReward,
    RootMeanSquare,
    SparseLearner,
    SpatialIndex,
    olgarb,
)
from motorgrad.learning.sparse._rows import greatest, write_rows
from motorgrad.policies import LocalGaussians, abilities, hyperplanes
from motorgrad.schema import build
from motorgrad.training import agent_for

RATES = {"centre": 2e-3, "log_width": 8e-3}


def pool_of(units=12, inputs=2, seed=0, width=0.2, p_max=0.6, limits=None):
    rng = np.random.default_rng(seed)
    log_width = np.log(width) + rng.normal(0, 0.4, (units, inputs))
    pool = LocalGaussians(rng.uniform(0, 1, (units, inputs)), log_width, p_max=p_max, log_width_limits=limits)
    return abilities.limited(pool)


def sparse_of(policy, estimator, rates, index):
    """The sparse learner that learns what the dense one of this estimator learns."""
    decay = estimator.trace.decay if isinstance(estimator.trace, Exponential) else 1.0
    parts = (estimator.baseline, estimator.discount, estimator.normalization)
    return SparseLearner(policy, decay, *parts, learning_rate=rates, index=index)


def life(agent, decisions, sparse=False, seed=1):
    """The policy after so many decisions on a walk with episodes, and how many tables were made."""
    rng, state, tables = np.random.default_rng(seed), started(agent), 0
    units = state.policy.outputs
    looks = rng.uniform(0, 1, (decisions + 1, state.policy.inputs)).astype(np.float32)
    numbers = rng.uniform(size=(decisions, units)).astype(np.float32)
    ends = rng.uniform(size=decisions) < 0.05

    @jax.jit
    def decide(state, look, after, uniforms, ended):
        def reward(action):
            return jnp.sin(7 * jnp.sum(action) + 3 * look[0])

        return decision(agent, state, look, uniforms, reward, after, terminated=ended).state

    for t in range(decisions):
        room = units
        if isinstance(agent, SparseLearner):
            if agent.due(state):
                state, tables = refreshed(agent, state), tables + 1
            room = state.index.table.shape[1]
        state = decide(state, looks[t], looks[t + 1], numbers[t, :room], ends[t])
    if isinstance(agent, SparseLearner):
        state = agent.publish(state)
    return state, tables


def close(one, other, rtol=1e-5, atol=2e-5):
    for mine, yours in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(mine, yours, rtol=rtol, atol=atol)


ESTIMATORS = {
    "0": olgarb(0.0),
    "0.1": olgarb(0.1),
    "0.9": olgarb(0.9),
    "0.9995": olgarb(0.9995),
    "constant": olgarb(0.8, Constant(0.3)),
    "episodic": Estimator(Episodic(), MeanReward()),
    "discount": Estimator(Exponential(0.95), MeanReward(), discount=0.97),
    "normalization": Estimator(Exponential(0.95), MeanReward(), normalization=RootMeanSquare(0.01)),
}


@pytest.mark.representatives("0.9-1")
@pytest.mark.parametrize(
    ("name", "rebase"),
    [
        *(pytest.param(name, 64, marks=[pytest.mark.ci] * (name == "discount")) for name in ESTIMATORS),
        ("0.9", 1),
        ("0.9", 7),
    ],
    ids=lambda value: f"{value}",
)
def test_with_every_unit_in_the_one_cell_it_learns_what_the_dense_learner_learns(name, rebase):
    start = pool_of(limits=(-2.0, -1.2))
    rates = {"centre": RATES["centre"], "log_width": np.linspace(0.004, 0.01, 12)[:, None]}
    index = SpatialIndex(neglect=1e-30, cells=1, rebase=rebase)
    estimator = ESTIMATORS[name]
    state, _ = life(sparse_of(start, estimator, rates, index), 150)
    dense, _ = life(Agent(start, estimator, SGD(rates)), 150)
    assert state.index.table.shape == (1, 12)
    close(state.policy, dense.policy)
    close(state.baseline, dense.estimator.baseline)
    moved = np.abs(dense.policy.log_width - start.log_width).max()
    assert moved > 0.05  # a tenth of what rounding may do to it would be seen


@pytest.mark.representatives("discount")
@pytest.mark.parametrize("name", ["0", "0.9", "0.9995", "discount"])
def test_units_out_of_sight_are_caught_up_with_whenever_that_is(name):
    estimator = ESTIMATORS[name]
    start = pool_of(60, width=0.05)
    decisions = 300 if name == "0" else 150  # without a memory less moves
    often, rarely = (
        life(sparse_of(start, estimator, 1e-5, SpatialIndex(cells=8, rebase=rebase)), decisions) for rebase in (1, 64)
    )
    assert often[1] == rarely[1] == 1  # another table would give units other numbers
    assert often[0].index.table.shape[1] < 40
    close(often[0].policy, rarely[0].policy)
    assert np.abs(often[0].policy.centre - start.centre).max() > 1e-3


@pytest.mark.slow
def test_units_out_of_sight_learn_from_their_traces_as_those_of_the_dense_learner():
    # two units far apart, so that the dense learner's probabilities and scores out of sight are exactly 0
    start = LocalGaussians([[0.0, 0.0], [1.0, 1.0]], np.full((2, 2), np.log(0.02)), p_max=0.5)
    index = SpatialIndex(cells=2, neglect=1e-6)
    agents = sparse_of(start, olgarb(0.9), 1e-5, index), Agent(start, olgarb(0.9), SGD(1e-5))
    places = np.array([[0.01, 0.0], [0.99, 1.01], [1.0, 0.98], [0.0, 0.015]], np.float32)
    states = [agent.init(jax.random.key(0)) for agent in agents]
    states[0] = refreshed(agents[0], states[0])
    assert states[0].index.table.shape[1] < 2 + 14
    rng = np.random.default_rng(3)
    for t in range(80):
        place, number, reward = places[rng.integers(4)], rng.uniform(), rng.normal()
        for n, agent in enumerate(agents):
            room = 2 if n else states[n].index.table.shape[1]
            states[n] = decided(
                agent, states[n], place, np.full(room, number), np.float32(reward), terminated=t % 37 == 36
            ).state
    close(agents[0].publish(states[0]).policy, states[1].policy)


@pytest.mark.slow
@settings(deadline=None, max_examples=5)
@given(seed=st.integers(0, 10**6), inputs=st.integers(1, 3), cells=st.integers(1, 9), margin=st.floats(0.05, 2))
def test_what_is_not_listed_fires_with_no_more_than_is_neglected_however_it_moves_within_its_margin(
    seed, inputs, cells, margin
):
    rng = np.random.default_rng(seed)
    index = SpatialIndex(neglect=10 ** rng.uniform(-4, -1), margin=margin, cells=cells)
    units = int(rng.integers(1, 80))
    p_max = rng.uniform(1e-4, 1, units)
    before = pool_of(units, inputs, seed, width=10 ** rng.uniform(-2.5, 0.5), p_max=p_max)
    low, size = index.grid(before)
    table = index.table(before, low, size)
    push = 10 ** rng.uniform(-3, 0.5, 2)
    after = dataclasses.replace(
        before,
        centre=before.centre + push[0] * rng.normal(size=(units, inputs)) * np.exp(before.log_width),
        log_width=before.log_width + push[1] * rng.normal(size=(units, inputs)),
    )
    within = np.asarray(index.strain(before, after)) <= 1
    looks = rng.uniform(-1, 2, (200, inputs)).astype(np.float32)
    for pool, counted in ((before, np.ones(units, bool)), (after, within)):
        p = np.asarray(jax.vmap(pool.prob)(looks))
        for look, fires in zip(looks, p, strict=True):
            hidden = np.setdiff1d(np.arange(units), table[int(index.cell(look, low, size, units))])
            assert fires[hidden][counted[hidden]].max(initial=0) <= index.neglect * (1 + 1e-4)


@eqx.filter_jit
def strains(index, before, theta):
    moved = eqx.apply_updates(before, abilities.from_blocks(before, (theta[0],)))
    step = abilities.from_blocks(before, (theta[1] * 1e-3,))
    after = eqx.apply_updates(moved, step)
    return index.strain(before, moved), index.strain(before, after), index.pace(moved, step)


@settings(deadline=None, max_examples=25)
@given(seed=st.integers(0, 10**6))
def test_the_pace_bounds_how_fast_strain_grows(seed):
    rng, index = np.random.default_rng(seed), SpatialIndex(margin=0.5)
    before = pool_of(50, seed=seed)
    theta = rng.normal(size=(2, 50, 4)) * np.exp(rng.uniform(-6, 0, (50, 1))) * 0.3
    now, then, bound = map(np.asarray, strains(index, before, theta))
    within = (now <= 1) & (then <= 1)
    # a step of finite size is longer by the widths that grow on the way
    assert (then - now)[within].max(initial=-1) <= (bound * 1.01 + 1e-6)[within].max(initial=0)
    assert ((then - now) <= bound * 1.01 + 1e-6)[within].all()


@pytest.mark.slow
def test_tables_are_made_before_what_is_neglected_could_be_more_than_it_may():
    start = pool_of(80, width=0.05)
    agent = sparse_of(start, olgarb(0.9), 3e-4, SpatialIndex(neglect=0.01, margin=0.6, cells=8))
    rng, state, tables, worst = np.random.default_rng(2), agent.init(jax.random.key(0)), 0, 0.0
    fire = jax.jit(lambda s, y: agent.publish(s).policy.prob(y))
    for _ in range(400):
        if agent.due(state):
            state, tables = refreshed(agent, state), tables + 1
        look = rng.uniform(0, 1, 2).astype(np.float32)
        near = np.asarray(state.index.table[agent.index.cell(look, state.index.low, state.index.size, 80)])
        fires = np.asarray(fire(state, look))
        worst = max(worst, fires[np.setdiff1d(np.arange(80), near)].max())
        numbers = rng.uniform(size=len(near)).astype(np.float32)
        reward, ended = np.float32(rng.normal()), bool(rng.uniform() < 0.03)
        found = decided(agent, state, look, numbers, reward, terminated=ended)
        assert set(np.flatnonzero(found.action)) <= set(near.tolist())
        state = found.state
    assert 0.0005 < worst <= 0.01 * (1 + 1e-4)
    assert 4 < tables < 200


@pytest.mark.parametrize("count", [1, 2, 256, 257, 1000, 4096])
def test_the_greatest_of_many_numbers_is_found_by_halves(count):
    numbers = np.random.default_rng(count).permutation(count).astype(np.float32)
    assert float(greatest(jnp.asarray(numbers))) == count - 1


def test_rows_are_put_where_they_belong_for_many_seeds_too():
    rng = np.random.default_rng(0)
    rows, new, count = rng.normal(size=(3, 9, 2)), rng.normal(size=(3, 4, 2)), np.array([0, 2, 4])
    units = np.stack([rng.permutation(9)[:4] for _ in range(3)])
    written = jax.jit(jax.vmap(write_rows))(rows, units, new, count)
    shared = jax.jit(jax.vmap(write_rows, in_axes=(None, 0, 0, 0)))(jnp.zeros(9), units, new[..., 0], count)
    alone = jax.jit(write_rows)
    for seed in range(3):
        wanted, line = rows[seed].copy(), np.zeros(9)
        wanted[units[seed, : count[seed]]] = new[seed, : count[seed]]
        line[units[seed, : count[seed]]] = new[seed, : count[seed], 0]
        np.testing.assert_allclose(written[seed], wanted, rtol=1e-6)
        np.testing.assert_allclose(alone(rows[seed], units[seed], new[seed], count[seed]), wanted, rtol=1e-6)
        np.testing.assert_allclose(shared[seed], line, rtol=1e-6)


@pytest.mark.ci
def test_a_saved_state_gets_the_same_table_again():
    agent = SparseLearner(pool_of(60, width=0.05), 0.9, learning_rate=3e-4)
    state, tables = life(agent, 200)
    assert tables > 1
    state = refreshed(agent, state) if agent.due(state) else state
    without = state._replace(index=state.index._replace(table=state.index.table[..., :0]))
    for mine, yours in zip(refreshed(agent, without).index, state.index, strict=True):
        np.testing.assert_array_equal(mine, yours)


@pytest.mark.slow
def test_a_diverged_decision_teaches_nothing_and_ends_the_episode():
    agent = SparseLearner(pool_of(), 0.9, learning_rate=1e-3)
    state = refreshed(agent, agent.init(jax.random.key(0)))
    after = decided(agent, state, np.zeros(2), np.full(12, 0.1), np.float32(9.0), diverged=True).state
    close(agent.publish(after).policy, pool_of(), atol=0)
    assert int(after.index.episode) == 1
    assert float(after.baseline.mean) == 0


@pytest.mark.parametrize(
    ("parts", "said"),
    [
        ({"baseline": LinearBaseline(0.1)}, "baseline = .*: must be None or a ScalarBaseline"),
        ({"index": 3}, "index = 3"),
    ],
)
def test_what_cannot_be_indexed_is_refused_by_name(parts, said):
    with pytest.raises(ValueError, match=said):
        SparseLearner(pool_of(), **parts)


@pytest.mark.parametrize("name", ["trace", "update_every", "optimizer", "weight_decay", "metric", "estimator"])
def test_settings_of_the_policy_gradient_alone_are_unknown(name):
    with pytest.raises(ValueError, match=f"unknown setting of agent '{name}'"):
        agent_for("particle", {"kind": "sparse", name: "none"})


@pytest.mark.parametrize("name", ESTIMATORS)
def test_it_takes_its_settings_from_the_policy_gradient_in_whose_place_it_is(name):
    dense = Agent(pool_of(), ESTIMATORS[name], SGD(RATES))
    found = build(Learner, {"kind": "sparse"}, "agent", dense)
    assert eqx.tree_equal(found, sparse_of(pool_of(), ESTIMATORS[name], RATES, SpatialIndex()))


def test_other_policies_and_impossible_numbers_are_refused():
    with pytest.raises(ValueError, match="policy = 'Hyperplanes': must be LocalGaussians where units are indexed"):
        SparseLearner(hyperplanes(2, 3)).init(jax.random.key(0))
    for name, value in (("neglect", 0), ("neglect", 1), ("margin", 0), ("cells", 0), ("rebase", 0), ("rebase", 2000)):
        with pytest.raises(ValueError, match=f"{name} = {value}"):
            SpatialIndex(**{name: value})
