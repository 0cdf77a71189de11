"""A learner as one tree: numbers are leaves, structure is static, and values are checked where they are given."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import optax
import pytest

import motorgrad as mg
from motorgrad.learning import (
    SGD,
    Adam,
    Agent,
    Annealed,
    Clock,
    Estimator,
    Exponential,
    FisherMetric,
    FixedStep,
    Part,
    Plateau,
    PolyakAveraging,
    RootMeanSquare,
    Trace,
    Transformation,
    Window,
    count,
    number,
    olgarb,
    register,
    static,
)
from motorgrad.policies import Softmax, trainable
from motorgrad.schema import Numbers, Range, check_rounded, declared_at, numbers_of, with_number
from motorgrad.tasks import ThreeState
from motorgrad.training import agent_for, agent_from_table, agent_table, stepper_for
from timsim.live._learner import agent_numbers

POINT = Softmax([[1.0, 1.0], [-1.0, -1.0]])  # Baxter & Bartlett's test point
RICH = Agent(
    POINT,
    Estimator(
        Exponential(0.8), FixedStep(0.05), 0.99, normalization=RootMeanSquare(0.01), entropy=Annealed(0.1, 0.0, 5)
    ),
    Adam({"weights": 0.01}, weight_decay=1e-3),
    FisherMetric(0.1, {"weights": [[0.1, 0.2]]}, kl=0.01),
    averaging=PolyakAveraging(2, 0.1),
)


def test_numbers_are_leaves_by_path_and_structure_is_not():
    assert {path: np.asarray(value).tolist() for path, value in numbers_of(RICH.hyperparameters).items()} == {
        "estimator.trace.decay": 0.8,
        "estimator.baseline.rate": 0.05,
        "estimator.discount": 0.99,
        "estimator.normalization.rate": 0.01,
        "estimator.entropy.start": 0.1,
        "estimator.entropy.end": 0.0,
        "optimizer.learning_rate.weights": 0.01,
        "optimizer.weight_decay": 1e-3,
        "optimizer.b1": 0.9,
        "optimizer.b2": 0.999,
        "metric.rate": 0.1,
        "metric.damping.weights": [[0.1, 0.2]],
        "metric.initial": 1.0,
        "metric.kl": 0.01,
        "averaging.rate": 0.1,
    }


def test_a_vector_of_numbers_makes_the_tree_again():
    tree = RICH.hyperparameters
    order = Numbers(tree)
    vector = order.vector(tree, np.float64)
    assert vector[order.places["optimizer.weight_decay"]] == 1e-3
    assert vector[order.places["metric.damping.weights"] + 1] == 0.2
    again = order.tree(vector)
    assert jax.tree.structure(again) == jax.tree.structure(tree)
    jax.tree.map(np.testing.assert_array_equal, again, tree)


def changed(path, value):
    return with_number(RICH, path, value)


@pytest.mark.parametrize(
    "path", ["estimator.trace.decay", "estimator.entropy.start", "optimizer.learning_rate.weights"]
)
def test_the_key_is_that_of_the_structure(path):
    key = Numbers(RICH.hyperparameters).key
    assert Numbers(changed(path, 0.25).hyperparameters).key == key
    others = (
        dataclasses.replace(RICH, averaging=PolyakAveraging(3, 0.1)),  # a count
        dataclasses.replace(RICH, averaging=None),
        dataclasses.replace(RICH, optimizer=SGD({"weights": 0.01}, 1e-3)),
        dataclasses.replace(RICH, metric=dataclasses.replace(RICH.metric, damping=0.1)),  # no array
        dataclasses.replace(RICH, estimator=dataclasses.replace(RICH.estimator, reduction="sum")),
    )
    assert len({key, *(Numbers(other.hyperparameters).key for other in others)}) == 1 + len(others)


@pytest.mark.parametrize(
    ("path", "absent"),
    [("estimator.entropy", None), ("estimator.discount", None), ("optimizer.weight_decay", None), ("metric.kl", None)],
)
def test_nought_never_removes_a_part(path, absent):
    """A number of 0 keeps the structure, so that it can be swept and moved live; only `None` is absence."""
    least = 0.0 if (declared_at(RICH, path).range or Range()).allows(0.0) else 1e-6
    outer, name = path.rsplit(".", 1)

    def with_value(value):
        return dataclasses.replace(RICH, **{outer: dataclasses.replace(getattr(RICH, outer), **{name: value})})

    nought, some, none = (with_value(value) for value in (least, 0.5, absent))
    assert Numbers(nought.hyperparameters).key == Numbers(some.hyperparameters).key
    assert Numbers(none.hyperparameters).key != Numbers(some.hyperparameters).key
    shapes = [jax.eval_shape(agent.init, jax.random.key(0)) for agent in (nought, some)]
    assert jax.tree.structure(shapes[0]) == jax.tree.structure(shapes[1])
    assert path in numbers_of(nought.hyperparameters)
    assert path not in numbers_of(none.hyperparameters)


def test_a_value_is_checked_where_it_is_given_and_tracers_pass():
    with pytest.raises(ValueError, match=r"decay = 2.0: must be in \[0, 1\]"):
        Exponential(2.0)
    with pytest.raises(ValueError, match=r"decay = True"):
        Exponential(True)
    with pytest.raises(ValueError, match=r"estimator.trace.decay = 2.0: must be in \[0, 1\]"):
        with_number(RICH, "estimator.trace.decay", 2.0)
    with pytest.raises(
        ValueError, match=r"unknown number 'estimator.trace.dekay': did you mean 'estimator.trace.decay'"
    ):
        with_number(RICH, "estimator.trace.dekay", 0.5)
    assert jax.jit(lambda decay: Exponential(decay).decay)(2.0) == 2.0
    assert jax.jit(lambda rate: SGD({"weights": rate}).learning_rate["weights"])(-1.0) == -1.0


@pytest.mark.parametrize("number_like", [1, np.float32(1), np.int64(1)])
def test_whole_and_numpys_numbers_are_kept_as_floats(number_like):
    trace = Exponential(number_like)
    assert type(trace.decay) is float
    assert trace == Exponential(1.0)


def test_a_number_is_checked_again_as_it_is_rounded():
    agent = Agent(POINT, Estimator(normalization=RootMeanSquare(1 - 1e-9)))
    with pytest.raises(
        ValueError, match=r"estimator.normalization.rate = 1.0: must be in \(0, 1\); it was rounded to float32"
    ):
        check_rounded(agent, np.float32)
    assert check_rounded(agent, np.float64).estimator.normalization.rate == 1 - 1e-9
    with pytest.raises(ValueError, match=r"estimator.normalization.rate = 1.0: .*rounded to float32"):
        agent_for("three-state", normalization={"rate": 1 - 1e-9})


@pytest.mark.ci
def test_hyperparameters_are_not_learned():
    state = jax.eval_shape(RICH.init, jax.random.key(0))
    learned = jax.tree.structure(trainable(POINT))
    assert jax.tree.structure(state.gradient) in (learned, jax.tree.structure(None))
    stepper = stepper_for(ThreeState(time_limit=9), RICH, [0, 1])
    before = stepper.state["cycle"].numbers
    stepper.advance(20)
    np.testing.assert_array_equal(stepper.state["cycle"].numbers, before)
    assert not np.array_equal(stepper.policies().weights, np.tile(POINT.weights, (2, 1, 1)))


class Clip(Transformation):
    """Clips every number of a step.

    **Arguments:**

    - `limit`: at least 0.
    """

    limit: float = number(1e-3, 0)

    def update(self, updates, state, policy, steps, due):
        return jax.tree.map(lambda update: jnp.clip(update, -self.limit, self.limit), updates), state


def learn(agent, decisions, numbers=None):
    """The weights of two seeds after so many decisions, and how far they moved at the last."""
    stepper = stepper_for(ThreeState(), agent, [0, 0], numbers=numbers)
    stepper.advance(decisions - 1)
    before = np.array(stepper.policies().weights)
    stepper.advance(1)
    return stepper.policies().weights, np.abs(stepper.policies().weights - before).max((1, 2))


@pytest.mark.ci
def test_a_transformation_of_ones_own_limits_steps_and_its_number_is_swept():
    agent = Agent(POINT, olgarb(0.8), SGD(1e4), transformations=(Clip(0.001),))
    assert "transformations.0.limit" in numbers_of(agent.hyperparameters)
    _, moved = learn(agent, 20, {"transformations.0.limit": [0.001, 0.0005]})
    np.testing.assert_allclose(moved, [0.001, 0.0005], rtol=1e-3)  # single precision of weights of size 1
    assert agent_table(agent)["transformations"][0]["limit"] == 0.001
    with pytest.raises(ValueError, match=r"transformations\.0.*is not registered: give the agent again"):
        agent_from_table(ThreeState(), agent_table(agent_for("three-state", transformations=(Clip(),))))


@pytest.mark.ci
def test_the_numbers_that_optax_injects_are_swept():
    agent = Agent(POINT, olgarb(0.8), optax.inject_hyperparams(optax.adam)(learning_rate=0.01))
    path = "optimizer.hyperparameters.learning_rate"
    assert numbers_of(agent.hyperparameters)[path] == pytest.approx(0.01)
    weights, _ = learn(agent, 20, {path: [0.01, 0.03]})
    for seed, rate in enumerate((0.01, 0.03)):
        other = Agent(POINT, olgarb(0.8), optax.adam(rate))
        np.testing.assert_allclose(weights[seed], learn(other, 20)[0][0], rtol=1e-5)


@pytest.mark.ci
def test_a_schedule_within_optax_stays_with_optax():
    schedule = optax.linear_schedule(0.1, 0.0, 10)
    agent = Agent(POINT, olgarb(0.8), optax.inject_hyperparams(optax.sgd)(learning_rate=schedule, momentum=0.0))
    assert set(agent.optimizer.hyperparameters) == {"momentum"}
    assert learn(agent, 20)[1].max() == 0


def test_a_number_moves_live_and_nothing_out_of_range_does():
    stepper = stepper_for(ThreeState(), Agent(POINT, olgarb(0.8), SGD(0.1)), [0, 1])
    stepper.advance(5)
    stepper.set_number("optimizer.learning_rate", 0.0)
    before = np.array(stepper.policies().weights)
    stepper.advance(5)
    np.testing.assert_array_equal(stepper.policies().weights, before)
    with pytest.raises(ValueError, match=r"optimizer.learning_rate = -1.0: must be a finite number of at least 0"):
        stepper.set_number("optimizer.learning_rate", -1.0)


def test_a_number_of_the_first_state_is_refused_while_the_learner_runs():
    agent = Agent(POINT, olgarb(0.8), SGD(0.1), metric=FisherMetric())
    stepper = stepper_for(ThreeState(), agent, [0])
    with pytest.raises(ValueError, match=r"metric.initial is used only at the start of a run"):
        stepper.set_number("metric.initial", 2.0)
    assert stepper.agent.metric.initial == FisherMetric().initial
    assert "agent.metric.initial" not in agent_numbers(agent)
    assert "agent.metric.rate" in agent_numbers(agent)


@pytest.mark.parametrize(
    ("base", "name", "part", "said"),
    [
        (Part, "mine", Clip, "base = .*: must be one of "),
        (Trace, "mine", Clip, "part = .*: must be a class that derives from Trace"),
        (Trace, "window", Exponential, "name = 'window': must be another name: it is that of Window"),
    ],
)
def test_what_cannot_be_registered_is_refused(base, name, part, said):
    with pytest.raises(ValueError, match=said):
        register(base, name, part)
    register(Trace, "window", Window)  # once more changes nothing


def test_fields_declare_what_they_take():
    class Example(Part):
        share: float = number(0.5, 0, 1, open_high=True)
        times: int = count(3, 1, 9)
        flag: bool = static(False)

    assert numbers_of(Example()) == {"share": 0.5}
    for wrong, said in (
        ({"share": 1.0}, r"share = 1.0: must be in \[0, 1\)"),
        ({"share": None}, "share = None"),
        ({"times": 10}, "times = 10: must be an integer from 1 to 9"),
        ({"times": 2.0}, "times = 2.0"),
        ({"flag": 1}, "flag = 1: must be True or False"),
    ):
        with pytest.raises(ValueError, match=said):
            Example(**wrong)


def test_parts_are_checked_before_they_are_put_together():
    for parts, said in (
        ({"estimator": 0.9, "averaging": PolyakAveraging()}, "estimator = 0.9: must be an Estimator"),
        ({"growth": Clock()}, "growth = .*: must be None or a Growth"),
        ({"transformations": (0.1,)}, "transformations.0 = 0.1: must be a Transformation"),
    ):
        with pytest.raises(ValueError, match=said):
            mg.Agent(POINT, **parts)


def test_settings_of_a_named_growth_change_the_criterion_that_it_names():
    changes = {"policy": "growing", "growth": "plateau", "growth.criterion.window": 6_000, "growth.units": 3}
    growth = agent_for("particle", changes).growth
    assert (growth.criterion, growth.units) == (Plateau(6_000), 3)
