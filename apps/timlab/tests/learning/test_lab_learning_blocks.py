"""Parts of learning as blocks, against the functions that they are made of."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import timlab
from motorgrad import learning, policies
from motorgrad.policies import abilities
from timlab.compiler import plan, stack

SIZE, TICKS = 3, 30


@pytest.mark.ci
def test_traces_are_the_librarys_filters_one_tick_late():
    made = timlab.Diagram(tick=1.0)
    made.add("score", timlab.UniformNoise(shape=(SIZE,)))
    made.add("chance", timlab.UniformNoise(low=0.0, high=1.0))
    made.add("ended", timlab.Expression("u < 0.15"))
    made.connect("chance", "ended")
    filters = {
        "exponential": (timlab.EligibilityTrace(0.8, size=SIZE), learning.Exponential(0.8)),
        "episodic": (timlab.EpisodicTrace(size=SIZE), learning.Episodic()),
        "window": (timlab.WindowTrace(4, size=SIZE), learning.Window(4)),
        "lagged": (timlab.LaggedTrace(2.0, 1.0, size=SIZE), learning.LaggedGaussian(2.0, 1.0)),
    }
    for name, (block, _) in filters.items():
        made.add(name, block)
        made.connect("score", f"{name}.score")
        made.connect("ended", f"{name}.ended")
    watch = ["score.y", "ended.y", *(f"{name}.trace" for name in filters)]
    record = timlab.Run(made, 2, watch=watch).advance(TICKS)
    ended = record["ended.y"][1]
    assert ended[:-1].any()
    for name, (_, rule) in filters.items():
        state = rule.init(jnp.zeros(SIZE))
        for tick in range(TICKS):
            np.testing.assert_allclose(record[f"{name}.trace"][1, tick], rule.value(state), rtol=1e-5, atol=1e-6)
            state = rule.init(jnp.zeros(SIZE)) if ended[tick] else state
            state = rule.update(state, jnp.asarray(record["score.y"][1, tick]))


def test_a_decay_that_is_retuned_acts_at_once_and_compiles_nothing():
    made = timlab.Diagram(tick=1.0)
    made.add("score", timlab.Constant(1.0, (1,)))
    made.add("trace", timlab.EligibilityTrace(0.5))
    made.connect("score", "trace.score")
    run = timlab.Run(made, 1, watch=["trace.trace"])
    run.advance(40)
    run["trace.decay"] = 0.0
    after = run.advance(3)["trace.trace"][0, :, 0]
    np.testing.assert_allclose(after, [2.0, 1.0, 1.0], rtol=1e-6)
    assert run.compilations == 1


def test_units_act_score_and_step_as_their_policy():
    pool = policies.Hyperplanes([[0.5, -1.0], [2.0, 0.1]], [0.3, -0.2])
    made = timlab.Diagram(tick=1.0)
    made.add("seen", timlab.Sine(frequency=(0.06, 0.13), shape=(2,)))
    made.add("step", timlab.Constant((0.1, 0, 0, 0, 0, -0.1), (6,)))
    made.add("units", timlab.Hyperplanes(2, 2, weights=((0.5, -1.0), (2.0, 0.1)), bias=(0.3, -0.2)))
    made.add("same", timlab.Hyperplanes(2, 2, source="wire", greedy=True))
    for source, target in (
        ("seen", "units.observation"),
        ("step", "units.step"),
        ("units.parameters", "same.parameters"),
        ("seen", "same.observation"),
    ):
        made.connect(source, target)
    watch = ["seen.y", *(f"units.{port}" for port in made.nodes["units"].block.outputs), "same.action"]
    record = timlab.Run(made, 3, watch=watch).advance(20)

    def told(seen, action, steps):
        moved = policies.Hyperplanes(pool.weights.at[0, 0].add(0.1 * steps), pool.bias.at[1].add(-0.1 * steps))
        return moved.prob(seen), ravel_pytree(moved.score(seen, action))[0], moved.mode(seen)

    steps = np.arange(1, 21, dtype=np.float32)
    probability, score, likely = jax.jit(jax.vmap(told))(record["seen.y"][1], record["units.action"][1], steps)
    np.testing.assert_allclose(record["units.probability"][1], probability, rtol=1e-4)
    np.testing.assert_allclose(record["units.score"][1], score, rtol=1e-4, atol=1e-5)
    np.testing.assert_array_equal(record["same.action"][1], likely)
    assert 0 < record["units.action"].mean() < 1


def test_local_units_keep_within_their_limits():
    made = timlab.Diagram(tick=1.0)
    made.add("seen", timlab.Constant(0.0, (1,)))
    made.add("step", timlab.Constant((0.0, 0.5), (2,)))
    made.add("units", timlab.Gaussians(1, 1, width=0.5, limits=(0.1, 2.0)))
    made.connect("seen", "units.observation")
    made.connect("step", "units.step")
    widths = np.exp(timlab.Run(made, 1, watch=["units.parameters"]).advance(9)["units.parameters"][0, :, 1])
    np.testing.assert_allclose(widths[[0, 1, -1]], [0.5 * np.exp(0.5), 0.5 * np.e, 2.0], rtol=1e-5)


def test_a_frozen_optimizer_learns_nothing_and_goes_on_when_thawed():
    made = timlab.Diagram(tick=1.0)
    made.add("gradient", timlab.Constant((0.3, -0.2), (2,)))
    made.add("optimizer", timlab.Adam(size=2, learning_rate=0.1))
    made.add("learned", timlab.BLOCKS["discrete integrator"](shape=(2,)))
    made.connect("gradient", "optimizer.gradient")
    made.connect("optimizer.step", "learned.u")
    run = timlab.Run(made, 2, watch=["learned.y"])
    run["optimizer.frozen"] = True
    still = run.advance(300)["learned.y"]
    assert np.ptp(still, axis=1).max() == 0
    run["optimizer.frozen"] = False
    assert np.ptp(run.advance(300)["learned.y"], axis=1).max() > 0
    assert run.compilations == 1


def test_weights_decay():
    made = timlab.Diagram(tick=1.0)
    made.add("units", timlab.Hyperplanes(1, 1, weights=2.0, bias=-1.0))
    made.add("seen", timlab.Constant(0.0, (1,)))
    made.add("none", timlab.Constant(0.0, (2,)))
    made.add("decay", timlab.WeightDecay(2, 0.25))
    for source, target in (
        ("seen", "units.observation"),
        ("none", "decay.step"),
        ("units.parameters", "decay.parameters"),
        ("decay.step", "units.step"),
    ):
        made.connect(source, target)
    seen = timlab.Run(made, 1, watch=["units.parameters"]).advance(4)["units.parameters"][0]
    np.testing.assert_allclose(seen, [[2, -1], [1.5, -0.75], [1.125, -0.5625], [0.84375, -0.421875]], rtol=1e-6)


def pools():
    made = timlab.Diagram(tick=1.0)
    made.add("seen", timlab.Constant(0.1, (1,)))
    for number in range(20):
        made.add(f"pool {number}", timlab.Motoneurons(2, threshold=number / 20, gain=3.0))
        made.connect("seen", f"pool {number}.observation")
    return made


def test_blocks_of_one_kind_are_one_stack():
    assert sum(len(kind.members) == 20 for kind in stack(plan(pools())).kinds) == 1


@pytest.mark.ci
def test_blocks_of_one_kind_are_evaluated_as_one():
    run = timlab.Run(pools(), 1, watch=["pool 3.probability", "pool 4.action", "pool 5.action"])
    record = run.advance(60)
    expected = 1 / (1 + np.exp(-3 * (0.1 - 0.15)))
    np.testing.assert_allclose(record["pool 3.probability"][0], np.full((60, 2), expected), rtol=1e-5)
    assert (record["pool 4.action"] != record["pool 5.action"]).any()


@pytest.mark.parametrize(
    ("make", "told"),
    [
        (lambda: timlab.Motoneurons(0), "units = 0: must be an integer"),
        (lambda: timlab.Motoneurons(2, threshold=(1.0, 2.0, 3.0)), "threshold: shape"),
        (lambda: timlab.Motoneurons(2, gain=float("nan")), "gain = nan"),
        (lambda: timlab.Softmax(2, "one"), "observed = 'one'"),
        (lambda: timlab.Gaussians(1, limits=(2.0, 1.0)), "limits"),
        (lambda: timlab.EligibilityTrace(1.5), "decay = 1.5"),
        (lambda: timlab.EligibilityTrace(size=0), "size = 0"),
        (lambda: timlab.WindowTrace(0), "length = 0"),
        (lambda: timlab.WindowTrace("ten"), "length = 'ten'"),
        (lambda: timlab.SGD(size=4, groups=(3, 2)), "add up to size = 4"),
        (lambda: timlab.SGD(learning_rate=-1.0), "learning_rate = -1.0"),
        (lambda: timlab.Adam(b1=1.0), r"b1 = 1.0: must be in \[0, 1\)"),
        (lambda: timlab.FixedStepBaseline(0.0), r"rate = 0.0: must be in \(0, 1\]"),
        (lambda: timlab.BinnedBaseline(low=2.0), "low, high = .*low < high"),
        (lambda: timlab.Critic(fit="lstd"), "unknown fit 'lstd'"),
        (lambda: timlab.NamedPolicy("tyles"), "did you mean 'tiles'"),
        (lambda: timlab.NamedPolicy("tiles", 2, 4, "copies = 9"), "policy.copies = 9"),
        (lambda: timlab.NamedPolicy("tiles", 2, 4, "width = 'wide'"), "policy.width"),
        (lambda: timlab.Learner(2, 2, "polcy = 'softmax'"), "did you mean 'policy'"),
        (lambda: timlab.Learner(2, 2, "kind = 'sparse'"), "settings.kind = 'sparse'"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(make, told):
    with pytest.raises(ValueError, match=told) as raised:
        make()
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("settings", "reads"),
    [
        ("policy = 'softmax'", False),
        ("policy = 'softmax'\nbaseline = 'critic'", True),
        ("kind = 'action-value-gradient'\npolicy = 'graded-hyperplanes'", True),
    ],
)
def test_a_learner_of_values_must_be_shown_what_an_action_led_to(settings, reads):
    """Zeros in its place would be learned from without a word."""
    port = timlab.Learner(2, 2, settings).inputs["next_observation"]
    assert (port.default is None) is reads


ODD = [None, True, -1, 0, 1.5, float("nan"), 1e30, 10**30, "", "x", (), (1, 2), ((1, 2), (3,)), ("a",), {"a": 1}, b"x"]


ROOMS = ("timlab.blocks.learning.", "timlab.blocks.worlds.")


def kinds():
    """The types of these rooms; a critic with a network has the fields of the critic and of the network."""
    found = [kind for kind in timlab.BLOCKS.values() if kind.__module__.startswith(ROOMS) and kind is not timlab.Fmu]
    # these make a policy or a critic of each value, and are refused by the same functions as the others
    slow_to_make = ("critic", "growing gaussians", "network", "network-critic baseline")
    later = dict.fromkeys(slow_to_make, pytest.mark.ci)
    return [pytest.param(kind, id=kind.name, marks=later.get(kind.name, ())) for kind in found]  # an FMU has its tests


@pytest.mark.parametrize("kind", kinds())
def test_odd_values_are_taken_or_refused_in_one_line(kind):
    refused = []
    for field in (*timlab.settings_of(kind), *timlab.parameters_of(kind)):
        for value in ODD:
            try:
                kind(**{field: value})
            except ValueError as error:
                refused.append(str(error))
    assert refused
    assert not any("\n" in told for told in refused)


@pytest.mark.ci
def test_units_with_hidden_units_and_with_a_memory_output_what_these_drew_and_what_is_remembered_until_a_restart():
    chosen = {"layered": {"hidden": (3, 2)}, "recurrent": {"hidden": 2}, "finite-state-controller": {"states": 3}}
    sizes = {"layered": (5, None), "recurrent": (None, 10), "finite-state-controller": (1, 3)}
    made = timlab.Diagram(tick=1.0)
    made.add("seen", timlab.UniformNoise(shape=(2,)))
    made.add("chance", timlab.UniformNoise(low=0.0, high=1.0))
    made.add("restart", timlab.Expression("u < 0.2"))
    made.connect("chance", "restart")
    watch = ["seen.y", "restart.y"]
    for name, settings in chosen.items():
        block = timlab.NamedPolicy(name, observed=2, units=2, settings=settings)
        made.add(name, block)
        made.connect("seen", f"{name}.observation")
        if "restart" in block.inputs:
            made.connect("restart", f"{name}.restart")
        shapes = {"hidden": block.outputs.get("hidden"), "memory": block.outputs.get("memory")}
        assert tuple(port and math.prod(port.shape) for port in shapes.values()) == sizes[name]
        watch += [f"{name}.{port}" for port in block.outputs]
    record = timlab.Run(made, 3, watch=watch).advance(TICKS)
    restart, observations = record["restart.y"][1], jnp.asarray(record["seen.y"][1])
    assert restart.any()
    assert not restart.all()

    def told(policy, before, observation, drawn):
        seen = abilities.observation_with_memory(policy, before, observation)
        score = ravel_pytree(policy.score(seen, drawn))[0]
        return abilities.task_action(policy, drawn), policy.prob(seen), score, abilities.remember(policy, seen, drawn)

    for name, settings in chosen.items():
        own = {port: record[f"{name}.{port}"][1] for port in made.nodes[name].block.outputs}
        assert record[f"{name}.action"].shape == (3, TICKS, 2)
        assert set(np.unique(record[f"{name}.action"])) == {0, 1}
        like = policies.initial(name, 2, units=2, **settings)(jax.random.key(0))
        policy = ravel_pytree(like)[1](jnp.asarray(own["parameters"][0]))  # no step moves the parameters
        before = None
        if abilities.has_memory(policy):
            start = np.asarray(abilities.initial_memory(policy))
            before = np.where(restart[:, None] > 0, start, np.concatenate([[start], own["memory"][:-1]]))
        drawn = jnp.asarray(np.concatenate([own.get("hidden", np.zeros((TICKS, 0))), own["action"]], axis=1), float)
        action, probability, score, memory = jax.jit(jax.vmap(told, (None, 0, 0, 0)))(
            policy, before, observations, drawn
        )
        np.testing.assert_array_equal(own["action"], action)
        np.testing.assert_allclose(own["probability"], probability, rtol=1e-5)
        np.testing.assert_allclose(own["score"], score, rtol=1e-4, atol=1e-5)
        if abilities.has_memory(policy):
            np.testing.assert_allclose(own["memory"], memory, rtol=1e-5, atol=1e-6)
        if abilities.has_hidden_units(policy):
            assert len(np.unique(own["hidden"])) > 1
