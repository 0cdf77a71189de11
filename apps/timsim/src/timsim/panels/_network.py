"""The hidden layers of a policy: the current activations of its units, and what each unit responds to."""

from __future__ import annotations

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np
import viser

from motorgrad.policies import Policy, abilities
from timsim.live import Session, Snapshot
from timsim.panels._panel import Numbers, Panel
from timsim.panels._policy_diagrams import Field, draw_layers, present
from timsim.panels._portrait import Portrait
from timsim.scene import Pose


class NetworkPanel(Panel):
    """Activations of the hidden units; the activation of one of them over two of the observations."""

    title: ClassVar[str] = "Network"
    rate: ClassVar[float] = 2.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.agent is not None and bool(_layers(session, session.snapshot()))

    def fill(self, gui: viser.GuiApi) -> None:
        session = self.session
        sizes = [len(layer) for layer in _layers(session, session.snapshot())]
        self._starts = np.cumsum([0, *sizes])
        with gui.add_folder("Hidden units"):
            self._units = gui.add_html("")
            names = tuple(f"layer {index + 1}" for index in range(len(sizes)))
            self._layer = gui.add_dropdown("Layer", names, initial_value=names[-1])
            self._unit = gui.add_slider("Hidden unit", 1, max(sizes), 1, 1)
        with gui.add_folder("What it responds to"):
            field = Field(lambda policy, seen: jnp.concatenate(abilities.hidden_activations(policy, seen)))
            self._portrait = Portrait(self, field)
            self._portrait.fill(gui)
        for each in (self._layer, self._unit):
            each.on_update(self.renew)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del pose
        layers = _layers(self.session, snapshot)
        policy = self.session.policy(snapshot)
        if policy is None:
            return
        layer = int(self._layer.value.split()[-1]) - 1
        unit = min(int(self._unit.value), len(layers[layer])) - 1
        self._units.content = draw_layers(layers, (layer, unit))
        place = int(self._starts[layer]) + unit
        self._portrait.show(policy, snapshot, place, f"unit {unit + 1} of layer {layer + 1}")

    def numbers(self) -> Numbers:
        layers = _layers(self.session, self.session.snapshot())
        layer = np.concatenate([np.full(len(each), index + 1) for index, each in enumerate(layers)])
        unit = np.concatenate([np.arange(len(each)) + 1 for each in layers])
        return {"layer": layer, "unit": unit, "activation": np.concatenate(layers)}


@jax.jit
def _activations(policy: Policy, memory: jax.Array, observation: jax.Array) -> tuple[jax.Array, ...]:
    acting, seen = present(policy, memory, observation)
    return abilities.hidden_activations(acting, seen)


def _layers(session: Session, snapshot: Snapshot) -> list[np.ndarray]:
    """The current activations of each hidden layer; empty for a policy without hidden layers."""
    policy = session.policy(snapshot)
    if policy is None:
        return []
    found = _activations(policy, jnp.asarray(snapshot.memory[0]), jnp.asarray(snapshot.observation[0]))
    return [np.asarray(layer) for layer in found]
