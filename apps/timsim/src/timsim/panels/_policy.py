"""The policy: its weights, its response to two of the observations, and the positions of its local units."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
import viser

from motorgrad.plane import has_local_units
from motorgrad.tasks import ParticleTask
from timsim.live import Session, Snapshot
from timsim.panels._motion_recorder import path_until
from timsim.panels._panel import Numbers, Panel, columns_of
from timsim.panels._policy_diagrams import Field, draw_arrows, weights_of
from timsim.panels._portrait import Portrait
from timsim.plane import PlanePicture
from timsim.scene import Pose

ALL = "all"
MANY = 12  # with more units, only one is shown at first
MEANING = {"discrete": "probability of {}", "continuous": "mean activation of {}"}
"""What a policy computes for a unit, by the kind of its action, where that is not a probability of firing."""


class PolicyPanel(Panel):
    """Weights as arrows; a phase portrait over the probability of firing, or the mean activation; ellipses of local
    units."""

    title: ClassVar[str] = "Policy"
    rate: ClassVar[float] = 2.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.agent is not None and len(session.observations) > 0

    def fill(self, gui: viser.GuiApi) -> None:
        session = self.session
        policy = session.policy(session.snapshot())
        units = (*session.actions,)
        self._units = None
        if has_local_units(session.task, policy):
            assert isinstance(session.task, ParticleTask)
            assert policy is not None
            self._units = PlanePicture(session.task, policy)
            with gui.add_folder("Units in the plane"):
                self._plane = gui.add_image(self._units.blank, format="png")
        self._arrows: Any = None
        if policy is not None and weights_of(policy) is not None:
            with gui.add_folder("Weights"):
                self._arrows = gui.add_html("")
                first = session.actions[0] if len(units) > MANY else ALL
                self._to = gui.add_dropdown("Arrows to", (ALL, *units), initial_value=first)
                self._to.on_update(self.renew)
        with gui.add_folder("Phase portrait"):
            self._portrait = Portrait(self, Field())
            self._portrait.fill(gui)
            self._unit = gui.add_dropdown("Unit", units, initial_value=session.actions[0])
            self._unit.on_update(self.renew)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del pose
        policy = self.session.policy(snapshot)
        if self._arrows is not None and policy is not None:
            self._show_weights(weights_of(policy), snapshot.probability[0])
        if self._units is not None and policy is not None:
            self._plane.image = self._units.paint(policy, path_until(self.session.trail(), snapshot))
        unit = self.session.actions.index(self._unit.value)
        kind = "" if policy is None else policy.actions if isinstance(policy.actions, str) else policy.actions[unit]
        what = MEANING.get(kind, "probability that {} fires").format(self._unit.value)
        self._portrait.show(policy, snapshot, unit, what, shares=kind != "continuous")

    def numbers(self) -> Numbers:
        trail = self.session.trail()
        senses = columns_of("observation", self.session.observations, trail.observation)
        chances = columns_of("probability", self.session.actions, trail.probability)
        return {"decision": trail.decision, "seconds": trail.seconds, **senses, **chances}

    def _show_weights(self, weights: np.ndarray | None, probability: np.ndarray) -> None:
        if weights is None:
            return
        units = self.session.actions
        rows = list(range(len(units))) if self._to.value == ALL else [units.index(self._to.value)]
        named = [units[row] for row in rows]
        senses = [*self.session.observations, "bias"]
        self._arrows.content = draw_arrows(weights[rows], senses, named, probability[rows])
