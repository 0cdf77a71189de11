"""Binary and graded units in one policy, as a task declares the kind of each action."""

import dataclasses
import json
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from policy_examples import compiled, scores_of_draws

import motorgrad as mg
from motorgrad.policies import (
    BoundedHyperplanes,
    Factored,
    GradedPool,
    Hyperplanes,
    LocalGaussians,
    Mixed,
    Softmax,
    abilities,
    describe,
    graded_hyperplanes,
    hyperplanes,
    initial,
    mixed,
    rebuild,
    trainable,
)
from motorgrad.tasks import LinearRecruitment
from motorgrad.training.engines import validate

KINDS = ("binary", "continuous", "continuous", "binary")


@dataclasses.dataclass(frozen=True)
class Partly(LinearRecruitment):
    """Recruitment whose outer units are on or off, and whose inner units are graded."""

    actions: Any = KINDS

    @property
    def accepted_actions(self):
        return (self.actions,)


def policy_of(seed):
    rng = np.random.default_rng(seed)
    strong = GradedPool(LocalGaussians(rng.normal(size=(2, 2)), np.zeros((2, 2))), rng.normal(size=2), [-1.0, -1.0])
    bounded = BoundedHyperplanes(rng.normal(size=(2, 2)), rng.normal(size=2), [-1.0, 0.0], low=[0.0, -2.0])
    return Mixed([Hyperplanes(rng.normal(size=(1, 2)), rng.normal(size=1)), strong, bounded])


@compiled
def together_and_apart(policy, seen, uniforms):
    shares = zip(policy.pools, jnp.split(uniforms, [1, 5]), strict=True)
    return policy.sample(seen, uniforms), [pool.sample(seen, share) for pool, share in shares]


def test_the_action_is_that_of_all_pools():
    policy, seen = policy_of(0), jnp.array([0.3, -0.2])
    assert policy.actions == ("binary",) + ("continuous",) * 4
    assert (policy.inputs, policy.outputs, policy.uniforms) == (2, 5, 7)
    rng = np.random.default_rng(1)
    uniforms = rng.random(7)
    whole, parts = together_and_apart(policy, seen, uniforms)
    np.testing.assert_allclose(whole, np.concatenate(parts), rtol=1e-6)
    for method in (policy.prob, policy.mode):
        assert jax.eval_shape(method, seen).shape == (5,)


@compiled
def with_blocks(policy, seen, uniforms):
    """Scores, the first of them through its blocks, the Fisher matrices, and those of each pool."""
    scores = scores_of_draws(policy, seen, uniforms)
    action = scores[0][0]
    again = abilities.from_blocks(policy, abilities.blocks(policy, policy.score(seen, action)))
    own = [matrix for pool in policy.pools for matrix in abilities.fisher(pool, seen, action[: pool.outputs])]
    return scores, again, abilities.fisher(policy, seen, action), own


def test_scores_are_derivatives_and_units_of_all_kinds_have_blocks():
    with jax.enable_x64(True):
        policy, seen = policy_of(1), jnp.array([0.3, -0.2])
        uniforms = np.random.default_rng(0).random((8, policy.uniforms))
        told = with_blocks(policy, seen, uniforms)
        (_, scores, derivatives), again, matrices, own = jax.tree.map(np.asarray, told)
        np.testing.assert_allclose(scores, derivatives, rtol=1e-8, atol=1e-8)
        assert jax.tree.structure(again) == jax.tree.structure(trainable(policy))
    assert [matrix.shape for matrix in matrices] == [(1, 3, 3), (2, 6, 6), (2, 4, 4)]
    for one, other in zip(matrices, own, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9)


def test_a_task_says_which_actions_are_graded():
    task = Partly()
    policy = initial("mixed", task, deviation=0.3)
    assert policy.actions == KINDS
    assert [pool.outputs for pool in policy.pools] == [1, 2, 1]
    np.testing.assert_array_equal(policy.pools[1].low, [0, 0])  # the range of the task's own actions
    validate(task, policy)
    with pytest.raises(ValueError, match=r"binary actions, but the task .* takes 1 binary, 2 continuous, 1 binary"):
        validate(task, hyperplanes(task))
    with pytest.raises(ValueError, match="1 binary, 1 continuous actions, but the task 'hopper' takes binary"):
        validate(mg.make("hopper"), Mixed([hyperplanes(3, 1), graded_hyperplanes(3, 1)]))


@pytest.mark.slow
@pytest.mark.ci
def test_both_kinds_learn_together():
    run = mg.train(Partly(), {"policy": "mixed", "learning_rate": 0.01, "metric": "fisher"}, 400, 2, progress=False)
    for pool, start in zip(run.policies.pools, run.initial.pools, strict=True):
        for one, other in zip(jax.tree.leaves(trainable(pool)), jax.tree.leaves(trainable(start)), strict=True):
            assert np.isfinite(one).all()
            assert not np.array_equal(one, other)


def test_an_environment_of_such_a_task_takes_numbers_in_their_ranges():
    from motorgrad.environments._spaces import check_action, spaces_of

    task = Partly()
    space = spaces_of(task)[1]
    found = check_action(space, np.float32([0.6, 0.5, 0.75, 0.25]), (), np.equal(task.actions, "binary"))
    np.testing.assert_array_equal(found, np.float32([1, 0.5, 0.75, 0]))
    with pytest.raises(ValueError, match=r"action = .*: must be numbers from 0 to 1"):
        check_action(space, np.float32([0.6, 0.5, 2.0, 0.25]))


def test_a_stored_policy_is_rebuilt():
    policy = policy_of(2)
    shapes = rebuild(json.loads(json.dumps(describe(policy))))
    assert jax.tree.structure(shapes) == jax.tree.structure(policy)


@pytest.mark.parametrize(
    ("build", "names"),
    [
        (lambda: Mixed([]), "pools = (): must be at least one pool"),
        (lambda: Mixed([hyperplanes(2, 1), hyperplanes(3, 1)]), "pools = [2, 3]: must be over observations of one"),
        (lambda: Mixed([Softmax(np.zeros((2, 2)))]), "pools = ['discrete']: must be pools of binary or graded units"),
        (lambda: mixed(2, 3, binary=3), "binary = 3: must be from 1 to 2, fewer than the 3 units"),
        (lambda: mixed(Partly(), 3), "units = 3: must be 4, one for each action of the task"),
        (lambda: Factored([policy_of(0)]), "pools = ['Mixed']: must be pools of binary units"),
        (lambda: abilities.enumerate(policy_of(0)), "Mixed: has infinitely many actions"),
    ],
)
def test_what_is_impossible_is_refused_by_name(build, names):
    with pytest.raises(ValueError) as error:  # noqa: PT011
        build()
    assert names in str(error.value)
