"""Abilities of policies: what is asked of any policy, what a class defines, and what wrappers pass on."""

import inspect

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from motorgrad.policies import (
    Featured,
    FeatureMap,
    Hyperplanes,
    Layered,
    Motoneurons,
    Policy,
    abilities,
    trainable,
)


class Wheel(Policy):
    """A direction on a wheel, drawn from a normal distribution of deviation 1: only what every policy has."""

    weights: jax.Array = eqx.field(converter=jnp.asarray)

    @property
    def inputs(self):
        return self.weights.shape[0]

    @property
    def outputs(self):
        return 1

    def prob(self, observation):
        return (self.weights @ observation)[None]

    def mode(self, observation):
        return self.prob(observation)

    def sample(self, observation, uniforms):
        return self.prob(observation) + jax.scipy.special.ndtri(uniforms)

    def log_prob(self, observation, action):
        return -0.5 * jnp.sum((action - self.prob(observation)) ** 2) - 0.5 * jnp.log(2 * jnp.pi)

    def score(self, observation, action):
        return eqx.tree_at(lambda p: p.weights, trainable(self), (action - self.prob(observation))[0] * observation)

    def entropy(self, observation):
        return 0.5 * jnp.log(2 * jnp.pi * jnp.e)


WHEEL = Wheel([0.5, -1.0])
LOOK = jnp.array([1.0, 2.0])
ACTION = jnp.array([0.5])
SCORES = jax.tree.map(lambda s: jnp.stack([0.5 * s, s]), WHEEL.score(LOOK, ACTION))
PLAIN = {
    "has_memory": ((), False),
    "initial_memory": ((), None),
    "observation_with_memory": ((None, LOOK), LOOK),
    "remember": ((LOOK, ACTION), None),
    "remembers_parameters": ((), False),
    "has_exact_score": ((), True),
    "marginal": ((), WHEEL),
    "critic_observation": ((LOOK,), LOOK),
    "has_hidden_units": ((), False),
    "task_action": ((ACTION,), ACTION),
    "hidden_activations": ((LOOK,), ()),
    "blocks": ((WHEEL.score(LOOK, ACTION),), (jnp.array([[2.0, 4.0]]),)),
    "from_blocks": (((jnp.array([[2.0, 4.0]]),),), WHEEL.score(LOOK, ACTION)),
    "fisher": ((LOOK, ACTION), (jnp.array([[[4.0, 8.0], [8.0, 16.0]]]),)),
    "sampled_fisher": ((LOOK, ACTION), (jnp.array([[[4.0, 8.0], [8.0, 16.0]]]),)),
    "fisher_sum": ((LOOK[None], ACTION[None], jnp.array([0.5])), (jnp.array([[[2.0, 4.0], [4.0, 8.0]]]),)),
    "fisher_sum_one_by_one": ((LOOK[None], ACTION[None], jnp.array([0.5])), (jnp.array([[[2.0, 4.0], [4.0, 8.0]]]),)),
    "score_sum": ((LOOK[None], ACTION[None], jnp.array([[0.5, 1.0]])), SCORES),
    "score_sum_one_by_one": ((LOOK[None], ACTION[None], jnp.array([[0.5, 1.0]])), SCORES),
    "entropy_sum": ((LOOK[None],), WHEEL.entropy(LOOK)),
    "sums_batches": ((), False),
    "fisher_coordinates": ((LOOK, ACTION), WHEEL.log_prob(LOOK, ACTION)[None]),
    "has_temperature": ((), False),
    "with_temperature": ((2.0,), WHEEL),
    "regions": ((), None),
    "entropy_estimate": ((LOOK, ACTION), WHEEL.entropy(LOOK)),
    "limited": ((), WHEEL),
    "allowed": ((trainable(WHEEL),), trainable(WHEEL)),
    "adapted": ((LOOK,), WHEEL),
}
"""What the functions answer for a policy without abilities: their arguments, and the answer."""


@pytest.mark.parametrize("question", PLAIN)
def test_a_policy_with_the_abstract_methods_alone_has_a_plain_answer_to_every_question(question):
    arguments, answer = PLAIN[question]
    found = getattr(abilities, question)(WHEEL, *arguments)
    assert jax.tree.structure(found) == jax.tree.structure(answer)
    jax.tree.map(lambda one, other: np.testing.assert_allclose(one, other, rtol=1e-6), found, answer)


def test_every_question_has_a_plain_answer_or_a_refusal():
    questions = {name for name in abilities.__all__ if inspect.isfunction(getattr(abilities, name))}
    assert questions - {"check_whole", "enumerate"} == PLAIN.keys()
    with pytest.raises(ValueError, match="Wheel: has infinitely many actions"):
        abilities.enumerate(WHEEL)


def test_all_that_a_policy_must_define_is_abstract():
    wanted = {"inputs", "outputs", "prob", "sample", "mode", "log_prob", "score", "entropy"}
    assert Policy.__abstractmethods__ == wanted
    of_abilities = {name for ability in abilities.ABILITIES for name in vars(ability) if name[0] != "_"}
    assert not of_abilities & set(vars(Policy))


def test_a_wrapper_has_hidden_units_and_finitely_many_actions_where_the_policy_within_has():
    features = FeatureMap(squares=True)
    plain = Hyperplanes(np.zeros((1, 4)), np.zeros(1))
    layered = Layered([Hyperplanes(np.zeros((2, 4)), np.zeros(2))], Hyperplanes(np.zeros((1, 2)), np.zeros(1)))
    for within, hidden, actions in ((plain, False, 2), (layered, True, 8)):
        policy = Featured(within, features, observed=2)
        assert abilities.has_hidden_units(policy) is hidden
        every = abilities.enumerate(policy)
        assert len(every) == actions
        assert abilities.task_action(policy, every[-1]).tolist() == [1.0]


def test_a_part_of_an_ability_is_refused_by_name():
    words = "Forgetful: has initial_memory, remember of Memory, but not observation_with_memory"
    with pytest.raises(TypeError, match=words):

        class Forgetful(Motoneurons):
            def initial_memory(self):
                return jnp.zeros(1)

            def remember(self, seen, action):
                return seen
