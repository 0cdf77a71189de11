"""Learners of every family, and one of a stranger's own, in a run that is watched."""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.flatten_util import ravel_pytree

import families
import motorgrad as mg
from motorgrad import learning, policies
from motorgrad.schema import PART_CLASSES, fields_of
from motorgrad.training import agent_for, stepper_for
from timsim import live


class TriedState(NamedTuple):
    policy: Any
    best: Any
    record: Any
    total: Any
    made: Any
    key: Any


class Neighbours(learning.Learner):
    """Tries neighbours of the best parameters so far: a stranger's learner, of the five functions alone."""

    trial: int = learning.count(5, 1, 1000, unit="decisions", help="length of a trial")
    spread: float = learning.number(0.3, 0, help="deviation of the parameters that are tried")

    def init(self, key):
        policy = self.first_policy(key)
        zero = jnp.zeros(())
        words = jax.random.key_data(key)
        return TriedState(policy, policies.trainable(policy), zero - jnp.inf, zero, jnp.zeros((), jnp.int32), words)

    def act(self, state, observation, uniforms):
        return state, state.policy.sample(observation, uniforms)

    def observe(self, state, transition):
        lost = jnp.asarray(transition.diverged)
        reward = jnp.where(lost, 0, transition.reward)
        return state._replace(total=state.total + reward, made=state.made + jnp.where(lost, 0, 1))

    def update(self, state):
        tried, fixed = policies.split(state.policy)
        better = state.total > state.record
        best = jax.tree.map(lambda new, old: jnp.where(better, new, old), tried, state.best)
        key = jax.random.fold_in(jax.random.wrap_key_data(state.key), 1)
        numbers, unravel = ravel_pytree(best)
        tried = unravel(numbers + self.spread * jax.random.normal(key, numbers.shape))
        record = jnp.maximum(state.total, state.record)
        words = jax.random.key_data(key)
        after = TriedState(eqx.combine(tried, fixed), best, record, jnp.zeros(()), jnp.zeros_like(state.made), words)
        return jax.tree.map(lambda new, old: jnp.where(state.made >= self.trial, new, old), after, state)

    def decisions_until_due(self, state):
        return self.trial - 1 - state.made


@pytest.fixture
def neighbours():
    learning.register(learning.Learner, "neighbours", Neighbours)
    yield
    del PART_CLASSES[learning.Learner]["neighbours"]


FAMILIES = {
    **{kind: families.compiled(kind)[1] for kind in families.FAMILIES},
    "neighbours": {"kind": "neighbours"},
}
QUICK = ("proximal", "neighbours")


def of(names):
    marked = [pytest.param(name, marks=() if name in QUICK else pytest.mark.ci) for name in names]
    return pytest.mark.parametrize("name", marked)


@of(FAMILIES)
def test_it_is_shown_and_learns_what_an_unwatched_one_does(name, driven, neighbours):
    task = mg.make("linear-recruitment")
    agent = agent_for(task, FAMILIES[name])
    watched = driven(live.setup_of(task, agent, seed=3))
    watched(live.Step(1), live.Step(60), live.Step(1))
    alone = stepper_for(task, agent, [3])
    before = alone.harvest()["parameters"][0]
    alone.advance(62)
    seen = watched.seen()
    np.testing.assert_array_equal(seen["parameters"][0], alone.harvest()["parameters"][0])
    assert np.ptp([seen["parameters"][0], before], axis=0).max() > 0
    assert np.isfinite(seen["probability"][0]).all()
    assert np.isfinite(seen["reward"][0])
    assert np.isfinite(seen["baseline"][0]) == (learning.Learner.kinds()[name].critic is not None)
    assert np.isfinite(seen["gradient_norm"][0]) == ("optimizer" in fields_of(learning.Learner.kinds()[name]))


@of(name for name in FAMILIES if name != "sparse")  # which is refused by name
def test_it_is_frozen_compared_and_taken_back(name, driven, neighbours, tmp_path):
    watched = driven(live.setup_of("linear-recruitment", FAMILIES[name], seed=3))
    subject = watched.worker.subject
    number, value = next((n, x) for n, x in subject.settings.items() if n.startswith("agent."))
    assert [kind for kind, _ in watched(live.Edit(number, 0.5 * value))] == ["change"]
    watched(live.Step(50), live.Freeze())
    frozen = watched.seen()
    watched(live.Step(30), live.Compare(True), live.Step(1))
    seen = watched.seen()
    for shown in ("parameters", "baseline"):
        np.testing.assert_array_equal(seen[shown][0], frozen[shown][0])
    assert np.isnan(seen["baseline"][1])
    watched(live.Thaw(), live.Step(60))
    end = watched.seen()
    assert np.any(end["parameters"][0] != frozen["parameters"][0])
    watched(live.Scrub(70))
    assert subject.frozen
    watched(live.Scrub(int(end["decision"])))
    np.testing.assert_array_equal(watched.seen()["parameters"][0], end["parameters"][0])
    file = str(tmp_path / "policy.npz")
    watched(live.Save(file), live.Freeze(), live.Reset())
    assert subject.frozen
    watched(live.Load(file), live.Step(5))
    np.testing.assert_array_equal(watched.seen()["parameters"][0], end["parameters"][0])
    watched(live.Thaw(), live.Step(1), live.Step(60))
    assert np.any(watched.seen()["parameters"][0] != end["parameters"][0])


def test_it_begins_frozen_and_learns_when_thawed(driven, neighbours):
    watched = driven(live.setup_of("linear-recruitment", FAMILIES["neighbours"], seed=3, frozen=True))
    start = watched.seen()["parameters"][0].copy()
    watched(live.Step(20))
    np.testing.assert_array_equal(watched.seen()["parameters"][0], start)
    watched(live.Thaw(), live.Step(20))
    assert np.any(watched.seen()["parameters"][0] != start)
