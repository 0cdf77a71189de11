"""Networks in diagrams: a policy with hidden layers, and a critic with its own."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import timlab
from motorgrad import policies
from motorgrad.policies import abilities

TICKS = 12


@pytest.mark.ci
@pytest.mark.parametrize("further", [{}, {"standardise": True, "unit_length": True}])
def test_a_network_acts_and_shows_its_hidden_units_as_the_policy(further):
    made = timlab.Diagram(tick=1.0)
    made.add("seen", timlab.UniformNoise(shape=(2,)))
    block = timlab.Network("softmax", 2, 3, hidden=(5, 4), sparsity=0.5, **further)
    made.add("network", block)
    made.connect("seen", "network.observation")
    size = block.outputs["parameters"].shape[0]
    assert (size, block.outputs["hidden"].shape) == (2 * 5 + 5 + 5 * 4 + 4 + 4 * 3, (9,))
    watch = ["seen.y", "network.hidden", "network.probability", "network.parameters"]
    record = timlab.Run(made, 2, watch=watch).advance(TICKS)
    start = policies.softmax(2, 3, network=policies.MultilayerPerceptron((5, 4), sparsity=0.5, **further))(
        jax.random.key(0)
    )
    learned, rest = policies.split(start)
    unravel = jax.flatten_util.ravel_pytree(learned)[1]
    for seed in range(2):
        policy = jax.tree.map(
            lambda a, b: b if a is None else a,
            unravel(jnp.asarray(record["network.parameters"][seed, 0], jnp.float32)),
            rest,
            is_leaf=lambda leaf: leaf is None,
        )
        for tick in range(TICKS):
            seen = jnp.asarray(record["seen.y"][seed, tick], jnp.float32)
            hidden = np.concatenate(abilities.hidden_activations(policy, seen)[:2])
            np.testing.assert_allclose(record["network.hidden"][seed, tick], hidden, rtol=1e-4, atol=1e-5)
            np.testing.assert_allclose(record["network.probability"][seed, tick], policy.prob(seen), rtol=1e-4)
            policy = abilities.adapted(policy, seen)
    one, other = record["network.parameters"][:, 0]
    assert np.any(one != other)  # each seed has its own


@pytest.mark.ci
def test_a_network_with_a_memory_standardises_what_it_observes():
    made = timlab.Diagram(tick=1.0)
    made.add("seen", timlab.Constant((0.3, -0.8), (2,)))
    settings = {"autocorrelation": 0.9}
    made.add("network", timlab.Network("bounded-hyperplanes", 2, 1, settings, hidden=(3,), standardise=True))
    made.connect("seen", "network.observation")
    record = timlab.Run(made, 2, watch=["network.hidden", "network.memory"]).advance(3)
    assert np.abs(record["network.hidden"][:, 0]).max() > 0.1  # before anything was seen
    np.testing.assert_array_equal(record["network.hidden"][:, 1:], 0)  # what is always the same is 0 from then on
    assert record["network.memory"].shape == (2, 3, 1)
    assert record["network.memory"].all()


def test_a_network_saved_before_it_had_some_settings_means_the_same():
    made = timlab.Diagram()
    made.add("network", timlab.Network("softmax", 2, 3, hidden=(5, 4)))
    text = timlab.dumps(made)
    older = text.replace(', "standardise": false, "unit_length": false', "")
    assert older != text
    assert timlab.loads(older) == made


@pytest.mark.parametrize(
    ("make", "names"),
    [
        (lambda: timlab.Network("tiles"), "unknown policy 'tiles'"),
        (lambda: timlab.Network(hidden=(0,)), "hidden[0] = 0"),
        (lambda: timlab.Network(settings="units = 2.5"), "units"),
    ],
)
def test_settings_of_a_network_are_refused_by_name(make, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        make()
    assert names in str(error.value)


@pytest.mark.ci
def test_the_critics_of_two_seeds_have_their_own_layers_and_learn():
    made = timlab.Diagram(tick=1.0)
    made.add("seen", timlab.UniformNoise(shape=(2,)))
    made.add("critic", timlab.BLOCKS["network-critic baseline"](hidden=(6,), discount=0.9, observed=2))
    made.add("reward", timlab.Constant(1.0))
    for source, target in (("seen", "observation"), ("seen", "next_observation"), ("reward", "reward")):
        made.connect(source, f"critic.{target}")
    record = timlab.Run(made, 2, watch=["critic.value", "critic.error"]).advance(200)
    values = record["critic.value"]
    assert np.any(values[0] != values[1])
    assert values[:, -20:].mean() > 1  # of the 10 that are to be had
