"""Traces, baselines, critics and the normalization of advantages as blocks."""

import dataclasses
import functools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
from jax.typing import DTypeLike
from jaxtyping import Array, Float, PyTree

from motorgrad import learning, policies
from motorgrad._errors import check
from motorgrad.schema import Declared, count, static
from timlab.blocks.learning._parts import PartBlock, usual_part
from timlab.blocks.learning._shared import MAX_PARAMETERS, MAX_UNITS, VALID, Vector, is_paid, reads, where
from timlab.blocks.learning._units import key_from
from timlab.diagram import Moment, Port, Ports, Signals

ENDED = Port((), "bool", feedthrough=False, default=0.0, help="whether an episode ended at this tick")


@dataclasses.dataclass(frozen=True, kw_only=True)
class TraceBlock(PartBlock):
    """The output is the trace of the actions *before* this tick, which a reward at this tick is for. So a trace cuts
    the loop of learning. It restarts where an episode has `ended`."""

    size: int = count(1, 1, MAX_PARAMETERS, help="number of parameters of the score")
    newest: bool = static(False, help="whether the newest score is an output too, for baselines of the observation")

    def validate(self) -> None:
        super().validate()
        if self._learns:
            wanted = f"False for a {self.name}, which learns what the newest score counts"
            check(not self.newest, "newest", True, wanted)

    def number_shape(self, declared: Declared) -> tuple[int, ...]:
        return () if self._learns else (self.size,)

    @property
    def _learns(self) -> bool:
        return self.part.learns  # type: ignore[attr-defined]

    @property
    def inputs(self) -> Ports:
        score = {"score": Port((self.size,), feedthrough=False), "ended": ENDED}
        if not self._learns:
            return score
        error = Port((), feedthrough=False, help="what the trace is multiplied by")
        return score | {"error": error, "valid": dataclasses.replace(VALID, feedthrough=False)}

    @property
    def outputs(self) -> Ports:
        trace = {"trace": Port((self.size,))}
        help = "the newest score, with the weight that the trace gives it"
        return trace | ({"newest": Port((self.size,), help=help)} if self.newest else {})

    def init(self, uniforms: Float[Array, " 0"]) -> PyTree[Array]:
        empty = self.bound_part.init(jnp.zeros(self.size))
        return (empty, jnp.zeros(self.size)) if self.newest else empty

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        trace: learning.Trace = self.bound_part
        if not self.newest:
            return {"trace": trace.value(state)}
        alone = trace.update(trace.init(jnp.zeros(self.size)), state[1])
        return {"trace": trace.value(state[0]), "newest": trace.value(alone)}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        trace: learning.Trace = self.bound_part
        score = inputs["score"]
        if self._learns:
            learned = trace.learn(state, inputs["error"])
            state = where(is_paid(inputs, now), learned, state)
            empty = trace.restart(state, jnp.zeros(self.size))
        else:
            empty = trace.init(jnp.zeros(self.size))
        after = trace.update(where(inputs["ended"], empty, state[0] if self.newest else state), score)
        return (after, score) if self.newest else after


@dataclasses.dataclass(frozen=True, kw_only=True)
class BaselineBlock(PartBlock):
    """The block compares a reward with the baseline, and then learns from it. A reward that is not `valid`, or comes
    before any action, has the error 0, and nothing is learned from it."""

    @property
    def inputs(self) -> Ports:
        restarts = self.part.restart is not learning.Baseline.restart  # type: ignore[attr-defined]
        return {"reward": Port(), "valid": VALID} | ({"ended": ENDED} if restarts else {})

    @property
    def outputs(self) -> Ports:
        newest = Port(help="what the newest action's error has beyond `error`")
        return {
            "error": Port(help="reward above the baseline"),
            "baseline": Port(help="present level of rewards"),
            **({"newest": newest} if self._splits else {}),
        }

    @property
    def _policy(self) -> policies.Policy:
        """A policy of the sizes that the baseline sees."""
        return policies.hyperplanes(1, 1)

    @functools.cached_property
    def _splits(self) -> bool:
        """Whether the newest action is compared with another baseline than older ones."""
        real = jnp.result_type(float)
        ports = {name: jax.ShapeDtypeStruct(port.shape, port.dtype) for name, port in self.inputs.items()}

        def advantage(inputs: Signals) -> learning.Advantage:
            start = self._start(self.template, real, jnp.zeros(self.init_uniforms, real))
            return self._update(self.template, start, inputs)[0]

        return jax.eval_shape(advantage, ports).newest is not None

    @property
    def init_uniforms(self) -> int:
        return int(self.part.starts_at_random)  # type: ignore[attr-defined]

    def _start(self, baseline: learning.Baseline, dtype: DTypeLike, uniforms: Array) -> PyTree[Array]:
        if not self.init_uniforms:
            return baseline.init(self._policy, dtype)
        return baseline.start(self._policy, dtype, key_from(uniforms))

    def _inner(self, state: PyTree[Array]) -> PyTree[Array]:
        """The state of the baseline within that of the block."""
        return state

    def _transition(self, state: PyTree[Array], inputs: Signals) -> learning.Transition:
        seen = jnp.zeros(1)  # which no such baseline reads
        return learning.Transition(seen, seen, inputs["reward"], seen, diverged=~inputs["valid"])

    def _update(
        self, baseline: learning.Baseline, state: PyTree[Array], inputs: Signals
    ) -> tuple[learning.Advantage, Any]:
        return baseline.update(self._inner(state), self._policy, self._transition(state, inputs))

    def init(self, uniforms: Float[Array, " init_uniforms"]) -> PyTree[Array]:
        return self._start(self.bound_part, jnp.result_type(float), uniforms)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        baseline = self.bound_part
        counts = is_paid(inputs, now)
        advantage = self._update(baseline, state, inputs)[0]
        found = {"error": jnp.where(counts, advantage.trace, 0), "baseline": baseline.level(self._inner(state))}
        return found if advantage.newest is None else found | {"newest": jnp.where(counts, advantage.newest, 0)}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        baseline = self.bound_part
        after = where(now.tick > 0, self._update(baseline, state, inputs)[1], self._inner(state))
        if "ended" in self.inputs:
            after = where(inputs["ended"], baseline.restart(after), after)
        return baseline.solve(after)


class Recalled(NamedTuple):
    """The state of a baseline, and the decision whose reward comes next."""

    baseline: Any
    observation: Float[Array, " observed"]
    action: Float[Array, " acted"]


@dataclasses.dataclass(frozen=True, kw_only=True)
class ObservingBaselineBlock(BaselineBlock):
    """The block compares a reward with what was expected on the observation, and then learns from it. `observation` is
    what the next action is chosen on, `next_observation` what the last one led to, before any reset.

    Where there is an output `newest`, older actions are compared with the level of rewards, and the newest with the
    baseline of its observation: wire `newest` to the gradient sample too, and the `newest` score of the trace.
    """

    observed: int = count(1, 1, MAX_UNITS, help="number of observed numbers")
    acted: int = count(1, 1, MAX_UNITS, help="number of numbers in an action")

    @property
    def inputs(self) -> Ports:
        seen = (self.observed,)
        action = "the action of this tick, for baselines that look at it"
        return {
            "observation": Port(seen, feedthrough=False),
            "next_observation": Port(seen, default=0.0, help="before any reset"),
            "action": Port((self.acted,), feedthrough=False, default=0.0, help=action),
            "reward": Port(),
            "terminated": Port((), "bool", default=0.0),
            "ended": ENDED,
            "valid": VALID,
        }

    @property
    def outputs(self) -> Ports:
        value = Port(help="of the observation on which the last action was taken")
        return {**super().outputs, **({"value": value} if hasattr(self.part, "value_at") else {})}

    @property
    def _policy(self) -> policies.Policy:
        return policies.hyperplanes(self.observed, self.acted)

    def _start(self, baseline: learning.Baseline, dtype: DTypeLike, uniforms: Array) -> Recalled:
        started = super()._start(baseline, dtype, uniforms)
        return Recalled(started, jnp.zeros(self.observed, dtype), jnp.zeros(self.acted, dtype))

    def _inner(self, state: Recalled) -> PyTree[Array]:
        return state.baseline

    def _transition(self, state: Recalled, inputs: Signals) -> learning.Transition:
        reward = inputs["reward"]
        following = inputs["next_observation"]
        flags = {"terminated": inputs["terminated"], "diverged": ~inputs["valid"]}
        return learning.Transition(state.observation, state.action, reward, following, **flags)

    def output(self, state: Recalled, inputs: Signals, now: Moment) -> Signals:
        found = super().output(state, inputs, now)
        if not hasattr(self.part, "value_at"):
            return found
        previous = getattr(state.baseline, "previous", None)  # of critics, which may look at actions
        seen = (state.observation,) if previous is None else (state.observation, previous)
        return found | {"value": self.bound_part.value_at(state.baseline, *seen)}

    def update(self, state: Recalled, inputs: Signals, now: Moment) -> Recalled:
        after = super().update(state, inputs, now)
        observation = inputs["observation"]
        return Recalled(self.bound_part.observe(after, observation), observation, inputs["action"])


@dataclasses.dataclass(frozen=True, kw_only=True)
class EligibilityBaselineBlock(BaselineBlock):
    """The block compares a reward with the baseline, and then learns from it and from the trace that it met. The
    parameters of its trace are one unit: give every unit a block of its own. `gradient` is the sample, with each
    parameter's own baseline."""

    size: int = count(1, 1, MAX_PARAMETERS, help="number of parameters of the trace")

    @property
    def inputs(self) -> Ports:
        return {"reward": Port(), "trace": Port((self.size,)), "valid": VALID}

    @property
    def outputs(self) -> Ports:
        return {
            "gradient": Port((self.size,), help="reward above the baseline, times the trace"),
            "baseline": Port(help="present level of rewards"),
        }

    @property
    def _policy(self) -> Any:
        return Vector(jnp.zeros(self.size))

    def _transition(self, state: PyTree[Array], inputs: Signals) -> learning.Transition:
        return super()._transition(state, inputs)._replace(eligibility=Vector(inputs["trace"]))

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        baseline: Any = self.bound_part
        error = self._update(baseline, state, inputs)[0].trace
        sample = (error.parameters if isinstance(error, Vector) else error) * inputs["trace"]
        return {"gradient": jnp.where(is_paid(inputs, now), sample, 0), "baseline": baseline.level(state)}


@functools.cache
def baseline_block(part: type[learning.Baseline]) -> type[BaselineBlock]:
    """The base class of a baseline's block: with ports for the observation where the baseline looks at it, and for the
    trace where it looks at that."""
    if part.needs_eligibility:
        return EligibilityBaselineBlock
    if issubclass(part, learning.ScalarBaseline):
        return BaselineBlock
    observes = part.observe is not learning.Baseline.observe or _reads_decision(part)
    return ObservingBaselineBlock if observes else BaselineBlock


def _reads_decision(part: type[learning.Baseline]) -> bool:
    """Whether a baseline learns from what was seen and done, which the traced function shows."""
    baseline = usual_part(part)
    policy = policies.hyperplanes(1, 1)

    def learned(seen: Array, action: Array, following: Array) -> Any:
        state = baseline.start(policy, seen.dtype, jax.random.key(0))
        return baseline.update(state, policy, learning.Transition(seen, action, jnp.zeros(()), following))

    one = jax.ShapeDtypeStruct((1,), jnp.result_type(float))
    return any(reads(learned, one, one, one))


@dataclasses.dataclass(frozen=True, kw_only=True)
class NormalizationBlock(PartBlock):
    """The block divides each `error`, the newest included; `newest` is scaled by the same factor."""

    @property
    def inputs(self) -> Ports:
        return {"error": Port(), "newest": Port(default=0.0, help="from a baseline of the observation"), "valid": VALID}

    @property
    def outputs(self) -> Ports:
        return {"error": Port(), "newest": Port()}

    def init(self, uniforms: Float[Array, " 0"]) -> PyTree[Array]:
        return self.bound_part.init(jnp.result_type(float))

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        factor = self.bound_part.factor(self.update(state, inputs, now))
        return {"error": factor * inputs["error"], "newest": factor * inputs["newest"]}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        advantage = inputs["error"] + inputs["newest"]
        return where(is_paid(inputs, now), self.bound_part.update(state, advantage), state)
