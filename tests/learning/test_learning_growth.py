"""The constructive algorithm: its schedule number by number, what the criteria see, and where units start."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from compiled_learner import decision, started, told

from motorgrad.learning import SGD, Adam, Agent, Clock, FisherMetric, Growth, Plateau, Visited, gpomdp, olgarb, olpomdp
from motorgrad.policies import FreeGaussians, Hyperplanes, LocalGaussians, Masked, SoftBoxes, SoftSpheres, growing

QUICK = Growth(Clock(12), shrink=0.8, width=1.0, cutoff=0.15)  # nine decisions: .8⁸ = .168, .8⁹ = .134


def learner(growth=QUICK, units=4, inputs=2, kind="gaussians", estimator=None, optimizer=None, **parts):
    return Agent(growing(inputs, units, kind), estimator or olgarb(0.5), optimizer or SGD(0.0), growth=growth, **parts)


def always(t, key):
    return jnp.float32(1.0)


def live(agent, decisions, seed=0, reward=always, look=None, start=None):
    """Decisions of a learner that sees `look(key)` and is paid `reward(t, key)`: the last state, and all states."""
    start = started(agent, seed) if start is None else start
    return _live(agent, decisions, reward, look, jax.random.key(seed), start)


@eqx.filter_jit
def _live(agent, decisions, reward, look, key, start):
    look = look or (lambda key: jax.random.uniform(key, (start.policy.inputs,)))

    def decide(state, t):
        keys = jax.random.split(jax.random.fold_in(key, t), 3)
        numbers = jax.random.uniform(keys[1], (state.policy.outputs,))
        state = decision(agent, state, look(keys[0]), numbers, reward(t, keys[2])).state
        return state, state

    return jax.lax.scan(decide, start, jnp.arange(decisions))


def widths(state, name="log_width"):
    return np.exp(np.asarray(getattr(state.policy.pool, name)))


def test_the_thesiss_adding_phase_has_7588_decisions_at_whose_end_the_width_is_the_cut_off():
    growth = Growth()
    assert growth.adding == 7_588
    state, history = live(learner(growth), 7_588)
    width = widths(history)[:, 0]
    assert widths(started(learner(growth)))[0] == pytest.approx([1.0, 1.0])
    # λ is a sum of as many roundings as there are decisions, 1e-7 each
    np.testing.assert_allclose(width[[0, 999, 7586]], 0.99975 ** np.array([[1], [1000], [7587]]) * [1, 1], rtol=1e-3)
    np.testing.assert_allclose(width[-1], 0.15, rtol=1e-4)
    assert (width[-2] > 0.15).all()
    assert state.growth.age == 7_588


def test_units_are_added_by_the_clock_in_the_pools_order_and_only_those_there_are():
    state, history = live(learner(units=3), 40)
    active = np.asarray(history.policy.active)
    counts = active.sum(1)
    np.testing.assert_array_equal(counts, np.repeat([1, 2, 3], [11, 12, 17]))  # after decision 12 and 24
    assert all((row == (np.arange(3) < n)).all() for row, n in zip(active, counts, strict=True))
    np.testing.assert_allclose(widths(history)[11, 1], 1.0, rtol=1e-6)
    np.testing.assert_allclose(widths(history)[12, 1], 0.8, rtol=1e-6)
    np.testing.assert_allclose(widths(state), 0.15, rtol=1e-5)
    np.testing.assert_allclose(state.policy.pool.centre, 0.5)


def noisy(mean):
    return lambda t, key: (mean(t) + 0.5 * jax.random.normal(key)).astype(jnp.float32)


@pytest.mark.representatives("None-optimizer0")
@pytest.mark.parametrize("optimizer", [SGD(0.01), Adam(0.01)])
@pytest.mark.parametrize("metric", [None, FisherMetric(rate=0.1)])
def test_the_newest_units_steps_are_eight_times_and_the_others_half_as_long_in_the_adding_phase(optimizer, metric):
    """One decision of a grown learner beside the same learner without the schedule."""
    growing_agent = learner(QUICK, optimizer=optimizer, metric=metric)
    paid = noisy(lambda t: 0.0)
    state, states = started(growing_agent), []
    for t in range(22):
        state = live(growing_agent, 1, t, paid, start=state)[0]
        states.append(state)
    plain = dataclasses.replace(growing_agent, growth=None)
    for after, factors in (
        (13, [0.5, 8.0]),
        (21, [1.0, 1.0]),
    ):  # the second unit's adding and learning phase
        state = states[after]
        before = np.asarray(state.policy.pool.centre)
        moved = [live(agent, 1, 9, paid, start=start)[0] for agent, start in
                 ((growing_agent, state), (plain, state._replace(growth=None)))]  # fmt: skip
        steps = [np.asarray(each.policy.pool.centre) - before for each in moved]
        assert np.abs(steps[1][:2]).min() > 0
        np.testing.assert_allclose(steps[0][:2], np.array(factors)[:, None] * steps[1][:2], rtol=1e-2, atol=1e-7)
        np.testing.assert_array_equal(steps[0][2:], 0)


@pytest.mark.ci
@pytest.mark.parametrize(
    ("kind", "field"), [("soft-boxes", "log_width"), ("soft-spheres", "log_radius"), ("oriented-boxes", "log_width")]
)
def test_boxes_and_spheres_grow_as_gaussians_do(kind, field):
    state, _ = live(learner(kind=kind), 30)
    assert isinstance(state.policy.pool, SoftBoxes | SoftSpheres)
    assert np.asarray(state.policy.active).sum() == 3
    np.testing.assert_allclose(widths(state, field)[:2], 0.15, rtol=1e-5)
    np.testing.assert_array_equal(np.exp(state.policy.pool.log_hardness), np.exp(np.log(np.float32(10))))


@pytest.mark.ci
def test_growth_is_complete_with_as_many_units_as_were_asked_for():
    state, _ = live(learner(dataclasses.replace(QUICK, units=2)), 60)
    np.testing.assert_array_equal(state.policy.active, [True, True, False, False])


@pytest.mark.ci
def test_units_that_were_there_stay_as_they_are_and_the_next_is_added():
    pool = LocalGaussians([[0.1], [0.9], [0.4]], [[-2.0], [-2.5], [-3.0]], 0.5)
    agent = Agent(Masked(pool, [False, True, False]), olgarb(0.5), SGD(0.0), growth=QUICK)
    state = started(agent)
    np.testing.assert_array_equal(state.policy.active, [True, True, False])
    np.testing.assert_allclose(state.policy.pool.centre[:, 0], [0.5, 0.9, 0.4])
    np.testing.assert_allclose(state.policy.pool.log_width[:, 0], [0.0, -2.5, -3.0])
    state, _ = live(agent, 30)
    assert np.asarray(state.policy.active).all()
    np.testing.assert_allclose(state.policy.pool.log_width[1], -2.5)


@pytest.mark.ci
def test_a_full_pool_does_not_grow_and_learns_at_the_plain_rates():
    pool = LocalGaussians([[0.1], [0.9]], [[-1.0], [-1.0]], 0.5)
    agent = Agent(Masked(pool), olgarb(0.5), SGD(0.01), growth=QUICK)
    state, plain = (live(dataclasses.replace(agent, growth=growth), 30)[0] for growth in (QUICK, None))
    np.testing.assert_array_equal(state.policy.pool.centre, plain.policy.pool.centre)
    assert state.growth.unit == -1


@pytest.mark.ci
def test_the_fisher_matrix_of_a_new_unit_begins_anew():
    agent = learner(metric=FisherMetric(rate=0.5, initial=2.0))
    _, history = live(agent, 12)
    before, after = (np.asarray(history.chain[0][0])[n] for n in (10, 11))
    assert before[1, 0, 0] < 0.01  # nothing of it is left: the unit was off
    np.testing.assert_array_equal(after[1], 2 * np.eye(4))
    assert (after[0] != 2 * np.eye(4)).any()


def plateau(**changes):
    return Growth(Plateau(**{"window": 400, "patience": 2, **changes}), shrink=0.8)


def added_at(history):
    counts = np.asarray(history.policy.active).sum(1)
    return np.flatnonzero(np.diff(counts)) + 2  # decisions; one unit is there from the start


@pytest.mark.ci
def test_a_reward_that_rises_adds_no_unit_and_one_that_stays_adds_one_after_two_windows():
    rising = noisy(lambda t: jnp.minimum(t, 2_000) * 2e-3)
    for seed in range(3):
        _, history = live(learner(plateau()), 4_000, seed, rising)
        first = added_at(history)[0]
        assert first > 2_000  # each window is better than the one before by .8, of an interval of .07
        assert first <= 2_000 + 3 * 400 + 9  # nine decisions of the adding phase came before the first window
    _, history = live(learner(plateau()), 900, 0, noisy(lambda t: 0.0))
    assert added_at(history)[0] == 9 + 800


@pytest.mark.slow
def test_no_unit_is_added_after_as_many_that_brought_nothing_as_patience_allows():
    for patience in (1, 2, 3):
        state, _ = live(learner(plateau(patience=patience), units=12), 14_000, 1, noisy(lambda t: 0.0))
        # the first level counts; then each unit has brought nothing
        assert np.asarray(state.policy.active).sum() == 1 + patience
        assert state.growth.criterion.vain == patience


@pytest.mark.ci
def test_units_that_bring_something_keep_growth_going():
    """The reward rises by much with every unit but the last of the pool's six: growth stops by itself after these."""
    agent = learner(plateau(patience=2), units=12)

    def decide(state, key):
        worth = jnp.minimum(jnp.sum(state.policy.active), 6)
        keys = jax.random.split(key)
        numbers = jax.random.uniform(keys[0], (12,))
        reward = worth + 0.5 * jax.random.normal(keys[1])
        return decision(agent, state, jnp.zeros(2), numbers, reward).state, None

    run = jax.jit(lambda key: jax.lax.scan(decide, agent.init(key), jax.random.split(key, 20_000))[0])
    state = run(jax.random.key(3))
    assert np.asarray(state.policy.active).sum() == 6 + 2
    assert float(state.growth.criterion.best) == pytest.approx(6, abs=0.2)


def test_a_plateaus_interval_is_that_of_the_difference_of_two_windows():
    """The share of flat windows of a level reward is the confidence's; far from the mean it is as exact."""
    judge = Plateau(window=200, confidence=0.8)

    def rose(level, key):
        rewards = level + jax.random.normal(key, (400,))
        settled = jnp.asarray(True)
        state, _ = jax.lax.scan(lambda s, r: (judge.add_reward(s, r, settled), None), judge.init(jnp.float32), rewards)
        return ~state.due

    keys = jax.random.split(jax.random.key(0), 4_000)
    shares = jax.jit(jax.vmap(jax.vmap(rose, (None, 0)), (0, None)))(np.array([0.0, 100.0], np.float32), keys)
    for share in np.asarray(shares):
        assert float(share.mean()) == pytest.approx(0.1, abs=0.02)  # one side of 80 %, with 19 degrees of freedom


@pytest.mark.ci
def test_a_diverged_decisions_reward_is_not_seen():
    agent = learner(plateau())
    state = started(agent)
    state = state._replace(growth=state.growth._replace(age=jnp.int32(50)))
    for diverged, rewards in ((True, 0), (False, 1)):
        after = told(agent, state, np.zeros(2), np.ones(4), np.nan if diverged else 1.0, diverged=diverged)[2]
        assert after.growth.criterion.rewards == rewards


def corner(key):
    return 3 + 0.2 * jax.random.uniform(key, (2,))


@pytest.mark.ci
def test_a_unit_is_placed_where_the_learner_has_been_of_late():
    growth = dataclasses.replace(QUICK, criterion=Clock(100), placement=Visited(slots=8, every=5))
    starts, agent = [], learner(growth, units=2)
    for seed in range(8):
        state, _ = live(agent, 101, seed, look=corner)
        np.testing.assert_allclose(state.policy.pool.centre[0], 0.5)  # the first knows nothing yet
        starts.append(np.asarray(state.policy.pool.centre[1]))
    assert (np.array(starts) >= 3).all()
    assert (np.array(starts) <= 3.2).all()
    assert len(np.unique(starts, axis=0)) == 8


def test_the_memory_is_an_even_sample_of_the_last_decisions():
    visited = Visited(slots=10, every=7)

    def go(salt):
        def see(state, t):
            return visited.observe(state, t[None].astype(jnp.float32), salt), None

        state, _ = jax.lax.scan(see, visited.init(1, jnp.float32), jnp.arange(700))
        return state.looks[:, 0], visited.draw(state, salt, jnp.zeros(1))[0]

    looks, drawn = jax.jit(jax.vmap(go))(jax.random.bits(jax.random.key(0), (2_000,), jnp.uint32))
    looks = np.sort(np.asarray(looks), axis=1)
    np.testing.assert_array_equal(looks // 7, np.tile(np.arange(90, 100), (2_000, 1)))  # one of each of the last blocks
    within = np.bincount((looks % 7).astype(int).ravel(), minlength=7) / looks.size
    np.testing.assert_allclose(within, 1 / 7, atol=0.01)
    assert np.isin(np.asarray(drawn), looks).all()
    share = np.bincount((np.asarray(drawn) // 7 - 90).astype(int), minlength=10) / 2_000
    np.testing.assert_allclose(share, 0.1, atol=0.03)


def test_an_observation_that_is_not_finite_is_never_kept():
    visited = Visited(slots=3, every=1)
    state, observe = visited.init(1, jnp.float32), jax.jit(visited.observe)
    for value in (1.0, np.nan, np.inf, 2.0):
        state = observe(state, np.array([value], np.float32), np.uint32(5))
    assert state.kept == 2
    np.testing.assert_array_equal(state.looks[:, 0], [1, 2, 0])


def test_without_growth_nothing_of_a_learner_changes():
    agent = Agent(Hyperplanes([[0.1, 0.2]], [0.0]), olgarb(0.5), SGD(0.1))
    state = agent.init(jax.random.key(0))
    assert state.growth is None
    plain = jax.make_jaxpr(lambda s: decision(agent, s, jnp.zeros(2), jnp.zeros(1), 1.0).state)(state)
    assert "select" not in str(plain)  # no mask, no schedule


@pytest.mark.ci
def test_it_grows_with_a_batch_learner_too():
    state, _ = live(learner(estimator=dataclasses.replace(olpomdp(0.5), update_every=5), optimizer=SGD(0.01)), 30)
    np.testing.assert_array_equal(state.policy.active, [True, True, True, False])
    assert np.isfinite(np.asarray(state.policy.pool.centre)).all()


@pytest.mark.ci
@pytest.mark.parametrize("criterion", [Clock(2_000), Plateau(window=1_000, patience=5)], ids=["clock", "plateau"])
@pytest.mark.parametrize("placement", [None, Visited()], ids=["centre", "visited"])
def test_units_find_the_two_places_where_firing_pays(criterion, placement):
    """Firing is paid 1 within .12 of .2 and of .8, and costs .5 elsewhere: no unit in the middle can do well."""
    growth = Growth(criterion, width=0.5, cutoff=0.08, shrink=0.998, centre=0.5, placement=placement)
    agent = learner(
        growth, units=4, inputs=1, estimator=olgarb(0.0), optimizer=SGD({"centre": 5e-4, "log_width": 2e-3})
    )
    good = lambda y: jnp.minimum(jnp.abs(y - 0.2), jnp.abs(y - 0.8)) < 0.12  # noqa: E731

    def decide(state, numbers):
        pays = jnp.where(good(numbers[0]), 1.0, -0.5)
        found = decision(agent, state, numbers[:1], numbers[1:], lambda action: jnp.max(action) * pays)
        return found.state, jnp.max(found.action) * pays

    def run(key):
        return jax.lax.scan(decide, agent.init(key), jax.random.uniform(key, (30_000, 5)))

    state, rewards = jax.jit(jax.vmap(run))(jax.random.split(jax.random.key(0), 4))
    assert (state.policy.active.sum(1) >= 2).all()
    early, late = rewards[:, :1_000].mean(), rewards[:, -5_000:].mean()
    assert early < 0.05
    assert late > 0.2  # .48 is all there is; units of half the height, p_max = .5, get half of it each


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Growth(width=0.0), "width = 0.0: must be a finite number above 0"),
        (lambda: Growth(cutoff=0.0), "cutoff = 0.0: must be a finite number above 0"),
        (lambda: Growth(cutoff=2.0), "cutoff = 2.0: must be at most the width, 1.0"),
        (lambda: Growth(shrink=1.0), "shrink = 1.0: must be in (0, 1)"),
        (lambda: Growth(boost=-1.0), "boost = -1.0"),
        (lambda: Growth(units=0), "units = 0: must be an integer of at least 1"),
        (lambda: Growth(Clock(7_587)), "interval = 7587: must be at least the 7,588 decisions of the adding phase"),
        (lambda: Growth(10_000), "criterion = 10000: must be a Criterion"),
        (lambda: Growth(placement="visited"), "placement = 'visited'"),
        (lambda: Growth(centre=float("nan")), "centre = nan: must be a finite number"),
        (lambda: Clock(0), "interval = 0"),
        (lambda: Plateau(window=39), "window = 39: must be an integer from 40"),
        (lambda: Plateau(confidence=1.0), "confidence = 1.0: must be in (0, 1)"),
        (lambda: Plateau(patience=0), "patience = 0: must be an integer from 1"),
        (lambda: Visited(slots=0), "slots = 0"),
        (lambda: Visited(every=0), "every = 0"),
        (lambda: learner(Growth(units=5)).init(jax.random.key(0)), "growth.units = 5: must be at most the pool's, 4"),
        (lambda: learner(Growth(centre=(0.5,) * 3)).init(jax.random.key(0)), "growth.centre = array([0.5, 0.5, 0.5])"),
        (lambda: Agent(Hyperplanes([[1.0]], [0.0]), growth=QUICK).init(jax.random.key(0)), "'Hyperplanes': must be a"),
        (
            lambda: Agent(Masked(FreeGaussians([[0.0]], [[0.0]], [0.0])), growth=QUICK).init(jax.random.key(0)),
            "'FreeGaussians': must be a Masked pool of local units that keep their height",
        ),
        (lambda: learner(growth="clock"), "growth = 'clock': must be None or a Growth"),
        (lambda: learner(estimator=gpomdp(0.5)), "growth"),
    ],
)
def test_impossible_schedules_are_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
