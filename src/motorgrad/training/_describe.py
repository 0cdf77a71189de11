"""A learner as a table: enough to tell two apart, and to rebuild the policy's structure."""

import dataclasses
from collections.abc import Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad import policies
from motorgrad._settings import table
from motorgrad.learning import Agent, Annealed, Growth, IndexedAgent, adam, decayed, sgd


def describe_agent(agent: Agent, policy: policies.Policy) -> dict[str, Any]:
    """An agent as a table: enough to tell two apart, and to rebuild the policy's structure."""
    estimator = table(agent.estimator)
    for part in ("trace", "baseline"):
        estimator[part] = _part(getattr(agent.estimator, part))
    if agent.estimator.entropy == 0:
        del estimator["entropy"]
    metric = {} if agent.metric is None else {"metric": {"kind": type(agent.metric).__name__, **_fields(agent.metric)}}
    return {
        "policy": policies.describe(policy),
        "estimator": estimator,
        "ascent": _rule(agent.ascent, policy),
        **metric,
        **({} if agent.average is None else {"average": table(agent.average)}),
        **({} if agent.growth is None else {"growth": _growth(agent.growth)}),
        **({"index": table(agent.index)} if isinstance(agent, IndexedAgent) else {}),
    }


def _part(part: Any) -> dict[str, Any]:
    """A part of the learner by its kind and its settings, those that are parts themselves likewise."""
    inner = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
    told = {name: _part(value) for name, value in inner.items() if dataclasses.is_dataclass(value)}
    return {"kind": type(part).__name__, **table(part), **told}


def _growth(growth: Growth) -> dict[str, Any]:
    criterion = {"kind": type(growth.criterion).__name__, **table(growth.criterion)}
    return {**table(growth), "criterion": criterion}


def _rule(rule: Any, policy: policies.Policy) -> dict[str, Any]:
    if isinstance(rule, decayed):
        return {**_rule(rule.rule, policy), "weight_decay": _numbers(rule.decay)}
    if isinstance(rule, sgd | adam):
        return {"kind": type(rule).__name__, **_fields(rule)}
    return {"kind": "optax", "state": str(_shape_of(rule, policy)), "steps": _first_steps(rule, policy)}


def _fields(part: Any) -> dict[str, Any]:
    given = {field.name: getattr(part, field.name) for field in dataclasses.fields(part)}
    return {name: _numbers(value) for name, value in given.items() if value is not None}


def _numbers(rate: Any) -> Any:
    if isinstance(rate, Annealed):
        return table(rate)
    return {name: _numbers(value) for name, value in rate.items()} if isinstance(rate, Mapping) else _listed(rate)


def _listed(value: Any) -> Any:
    return np.asarray(value).tolist()


def _first_steps(rule: Any, policy: policies.Policy) -> list[str]:
    """What a rule makes of a few gradients: optax keeps its constants to itself, but most of them tell here."""

    def fill(value: float) -> Any:
        return policies.trainable(jax.tree.map(lambda leaf: jnp.full(leaf.shape, value, leaf.dtype), policy))

    parameters, said = fill(1.0), []
    state = rule.init(parameters)
    for gradient in (1.0, -0.5, 30.0):
        step, state = rule.update(fill(gradient), state, parameters)
        said.append(f"{sum(float(jnp.sum(leaf)) for leaf in jax.tree.leaves(step)):.5g}")
    return said


def _shape_of(rule: Any, policy: policies.Policy) -> Any:
    return jax.tree.structure(jax.eval_shape(rule.init, policies.trainable(policy)))
