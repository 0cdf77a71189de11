"""The policy: its weights, its response to two of the observations, and the positions of its local units."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from motorgrad.sim.live import Session, Snapshot
from motorgrad.sim.panels._panel import Numbers, Panel, columns_of
from motorgrad.sim.panels._policy_diagrams import Field, draw_arrows, draw_portrait, limits_of, weights_of
from motorgrad.sim.plane import PlanePicture, has_local_units
from motorgrad.sim.scene import Pose

ALL = "all"
MANY = 12  # with more units, only one is shown at first


class PolicyPanel(Panel):
    """Weights as arrows; a phase portrait over the probability of firing; ellipses of local units."""

    title: ClassVar[str] = "Policy"
    rate: ClassVar[float] = 2.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.agent is not None and len(session.observations) > 0

    def fill(self, gui: Any) -> None:
        session = self.session
        self._field = Field()
        policy = session.policy(session.snapshot().parameters[0])
        units, senses = (*session.actions,), (*session.observations,)
        self._units = None
        if has_local_units(session.task, policy):
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
            self._portrait = gui.add_html("")
            moving = session.observations[-2:]
            self._x = gui.add_dropdown("Across", senses, initial_value=moving[0])
            self._y = gui.add_dropdown("Up", senses, initial_value=moving[-1])
            self._unit = gui.add_dropdown("Unit", units, initial_value=session.actions[0])
            for each in (self._x, self._y, self._unit):
                each.on_update(self.renew)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del pose
        policy = self.session.policy(snapshot.parameters[0])
        trail = self.session.trail()
        if self._arrows is not None and policy is not None:
            self._show_weights(weights_of(policy), snapshot.probability[0])
        if self._units is not None and policy is not None:
            self._plane.image = self._units.paint(policy, trail.position[:, :2])
        self._show_portrait(policy, snapshot, trail.observation)

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

    def _show_portrait(self, policy: Any, snapshot: Snapshot, seen: np.ndarray) -> None:
        session = self.session
        x, y = (session.observations.index(each.value) for each in (self._x, self._y))
        unit = session.actions.index(self._unit.value)
        path = seen[:, [x, y]]
        path = path[np.all(np.isfinite(path), axis=1)]
        if not len(path):
            return
        limits = limits_of(path)
        chance = None
        if policy is not None and x != y:
            chance = self._field.over(policy, snapshot.observation[0], x, y, limits)[..., unit]
        names = (session.observations[x], session.observations[y])
        what = f"probability that {session.actions[unit]} fires"
        self._portrait.content = draw_portrait(path, chance, limits, names, what)
