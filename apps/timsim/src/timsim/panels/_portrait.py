"""A phase portrait with its settings, which the tabs Policy and Network share."""

from __future__ import annotations

import numpy as np
import viser

from motorgrad.policies import Policy, abilities
from timsim.live import Snapshot
from timsim.panels._panel import Panel, brief
from timsim.panels._policy_diagrams import Field, draw_portrait, limits_of


class Portrait:
    """The trajectory over two observations that the user chooses, and what the policy computes from these two, with the
    others and its memory as they are.

    **Arguments:** `panel`, to which it belongs; `field`, what the policy computes.
    """

    def __init__(self, panel: Panel, field: Field):
        self._panel, self._field = panel, field

    def fill(self, gui: viser.GuiApi) -> None:
        """Add the picture and the choice of the two observations."""
        senses = (*self._panel.session.observations,)
        moving = senses[-2:]
        self._picture = gui.add_html("")
        self._axes = [
            gui.add_dropdown("Across", senses, initial_value=moving[0]),
            gui.add_dropdown("Up", senses, initial_value=moving[-1]),
        ]
        for each in self._axes:
            each.on_update(self._panel.renew)

    @property
    def content(self) -> str:
        """The picture as HTML."""
        return self._picture.content

    def show(self, policy: Policy | None, snapshot: Snapshot, unit: int, what: str, shares: bool = False) -> None:
        """Draw what one unit computes, by its place in the field, with `what` it is in words. Its colours range over
        [0, 1] if they are `shares`, else over what occurs."""
        session = self._panel.session
        senses = session.observations
        x, y = (senses.index(each.value) for each in self._axes)
        path = session.trail().observation[:, [x, y]]
        path = path[np.all(np.isfinite(path), axis=1)]
        if not len(path):
            return
        limits = limits_of(path)
        found = None
        ends = ("0", "1")
        note = ""
        if policy is not None and x != y:
            found = self._field.over(policy, snapshot.memory[0], snapshot.observation[0], x, y, limits)[..., unit]
            if not shares:
                least = float(found.min())
                most = float(found.max())
                found = (found - least) / max(most - least, 1e-12)
                ends = (brief(least, 2), brief(most, 2))
            remembers = abilities.has_memory(abilities.marginal(policy))
            kept = ["the other observations"] * (len(senses) > 2) + ["the memory"] * remembers
            note = f"{' and '.join(kept)} as now" if kept else ""
        self._picture.content = draw_portrait(path, found, limits, (senses[x], senses[y]), what, ends, note)
