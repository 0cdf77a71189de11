"""The policy of a run as a diagram, of which a Functional Mock-up Unit is made."""

import dataclasses
from typing import Any, ClassVar

from jaxtyping import Array, PyTree

from motorgrad._errors import plain
from motorgrad.policies import Actor, Policy, abilities, decide
from timlab.diagram import Block, Diagram, Inlet, Moment, Outlet, Port, Ports, Signals


@dataclasses.dataclass(frozen=True, eq=False)
class Deciding(Block):
    """The most probable action of a policy: raw observations in, raw actions out. It keeps the memory of the policy."""

    name: ClassVar[str] = "policy of a run"
    category: ClassVar[str] = "learning"

    policy: Any = None

    @property
    def inputs(self) -> Ports:
        return {"observation": Port((self.policy.interface.observations.size,))}

    @property
    def outputs(self) -> Ports:
        code = self.policy.interface.actions
        whole = code.kind == "discrete" and code.form == "same"
        return {"action": Port((code.outputs,) if code.shape else (), "int" if whole else "float")}

    def init(self, uniforms: Array) -> PyTree[Array]:
        memory = abilities.initial_memory(self.policy)
        return () if memory is None else memory

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        action = decide(self.policy, state if abilities.has_memory(self.policy) else None, inputs["observation"]).action
        return {"action": self.policy.interface.decode(action)}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        if not abilities.has_memory(self.policy):
            return state
        return decide(self.policy, state, inputs["observation"]).memory


def policy_diagram(policy: Policy) -> Diagram:
    """A diagram with the inlet `observation` and the outlet `action`, whose tick is the period of decisions.

    **Raises:** `ValueError` for a policy without an interface.
    """
    block = Deciding(Actor(policy).policy)
    diagram = Diagram(tick=block.policy.interface.period)
    diagram.add("observation", Inlet(shape=block.inputs["observation"].shape))
    diagram.add("policy", block)
    out = block.outputs["action"]
    diagram.add("action", Outlet(shape=out.shape, kind=out.kind))
    diagram.connect("observation", "policy")
    diagram.connect("policy", "action")
    return diagram


def names_of(policy: Policy) -> dict[str, tuple[str, ...]]:
    """What the numbers of the inlet and of the outlet are, where they have names, as a simulator may show it."""
    interface = Actor(policy).interface
    found = {"observation": tuple(map(plain, interface.observations.names))}
    code = interface.actions
    if code.names and len(code.names) == code.outputs and code.kind != "discrete":
        found["action"] = tuple(map(plain, code.names))
    return found
