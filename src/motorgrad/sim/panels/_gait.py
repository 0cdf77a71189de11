"""How a hexapod walks."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from motorgrad.sim.panels._footfall import draw_footfall
from motorgrad.sim.panels._numbers import brief, table
from motorgrad.sim.panels._panel import Numbers, Panel
from motorgrad.sim.panels._walked import Walked, is_hexapod

if TYPE_CHECKING:
    from motorgrad.sim.live import Session, Snapshot
    from motorgrad.sim.scene import Pose


class GaitPanel(Panel):
    """Footfall diagram; gait class, speed, phase between the tripods, stride frequency, duty factor."""

    title: ClassVar[str] = "Gait"
    icon: ClassVar[str] = "shoe"
    rate: ClassVar[float] = 2.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        from motorgrad.bodies import LEGS

        return is_hexapod(session.model) and {f"contact_{leg}" for leg in LEGS} <= set(session.feet)

    def fill(self, gui: Any) -> None:
        self._said = gui.add_html("")
        self._diagram = gui.add_html("")
        self._walked = Walked(self.model, self.session.period, self.session.feet)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        from motorgrad.bodies import LEGS, TRIPODS

        del snapshot, pose
        trail = self.session.trail()
        names = [leg.replace("_", " ") for leg in LEGS]
        first = [leg in TRIPODS[0] for leg in LEGS]
        contact = self._walked.contacts(trail)
        self._diagram.content = draw_footfall(trail.seconds, contact, names, first, self.session.period)
        gait = self._walked.gait(trail)
        if gait is None:
            self._said.content = table([("gait", "not yet known: too little in one piece")])
            return
        self._said.content = table(
            [
                ("gait", str(gait.kind[0])),
                ("speed", f"{brief(float(gait.speed[0]))} m/s"),
                ("phase between tripods", f"{brief(float(gait.phase[0]), 2)} of a cycle"),
                ("correlation of tripods", brief(float(gait.correlation[0]), 2)),
                ("stride frequency", f"{brief(float(gait.frequency[0]))} Hz"),
                ("duty factor", f"{float(gait.duty[0]):.0%}"),
            ]
        )

    def numbers(self) -> Numbers:
        from motorgrad.bodies import LEGS

        trail = self.session.trail()
        contact = self._walked.contacts(trail)
        touching = {f"on the ground {leg}": column for leg, column in zip(LEGS, contact.astype(int).T, strict=True)}
        force = {
            f"force {name} (N)": np.asarray(row) for name, row in zip(self.session.feet, trail.contacts.T, strict=True)
        }
        return {"decision": trail.decision, "seconds": trail.seconds, **touching, **force}
