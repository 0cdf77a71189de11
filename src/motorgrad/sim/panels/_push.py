"""Pushes: a force on a part of the body for a moment, by button, by key or by dragging."""

# pyright: reportAttributeAccessIssue=false
# (the bindings of mujoco carry no types)
from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad.sim.panels._panel import command, notify

if TYPE_CHECKING:
    import viser

    from motorgrad.sim.live import Session, Snapshot
    from motorgrad.sim.panels._panel import Panel
    from motorgrad.sim.scene import Pose

DIRECTIONS = {
    "+x": (1.0, 0.0, 0.0),
    "−x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "−y": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "down": (0.0, 0.0, -1.0),
}
PULL = 5.0
"""Of a drag by the size of the body: so many times its weight."""
SHARE = 0.5  # of the weight, to begin with
HELD = 0.1  # seconds that a pull lasts, unless the drag goes on


class PushFolder:
    """Which part, which way, how hard and how long.

    **Arguments:** the panel that it stands in.
    """

    def __init__(self, panel: Panel) -> None:
        self._panel = panel

    def fill(self, gui: Any) -> None:
        """Add the elements."""
        model = self._panel.model
        names = [model.body(index).name for index in range(1, model.nbody)]
        named = [name for name in names if name]
        if not named:
            return
        moving = [name for name in named if model.body_weldid[model.body(name).id] != 0] or named
        weight = weight_of(model)
        with gui.add_folder("Push"):
            self._body = gui.add_dropdown("Part", moving, initial_value=moving[0])
            first = movable(model, moving[0])
            self._way = gui.add_dropdown("Direction", (*DIRECTIONS,), initial_value=first, hint="Of the world.")
            strength = float(f"{SHARE * weight:.1g}")
            self._strength = gui.add_number("Force (N)", strength, min=0.0, step=strength / 10)
            self._seconds = gui.add_number("For (s)", 0.1, min=0.01, max=60.0, step=0.01)
            button = gui.add_button("Push", icon="hand-finger")
            button.on_click(self._panel.guarded(self._push))
        command(gui, "Push", "P", self._panel.guarded(self._push))

    def _push(self, _: Any) -> None:
        from motorgrad.sim.live import Push

        x, y, z = (self._strength.value * part for part in DIRECTIONS[self._way.value])
        self._panel.order(Push(self._body.value, (x, y, z), self._seconds.value))


def movable(model: Any, part: str) -> str:
    """The first direction in which a part can be moved at the start: not every body is free."""
    import mujoco

    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_fwdPosition(model, data)
    shifts = np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, shifts, None, model.body(part).id)
    free = [name for name, way in DIRECTIONS.items() if np.abs(way @ shifts).max(initial=0.0) > 1e-6]
    return free[0] if free else next(iter(DIRECTIONS))


def weight_of(model: Any) -> float:
    """The weight of all that moves, in N; 1 where nothing has any."""
    moving = np.asarray(model.body_weldid) != 0
    pull = float(np.linalg.norm(model.opt.gravity)) or 9.81
    return float(np.sum(model.body_mass[moving])) * pull or 1.0


class DragPush:
    """Parts of the body that are dragged with Ctrl (or Cmd) held are pulled towards the pointer while they are.

    A part of a page, which is renewed after the scene. **Arguments:** `grips`, a function that gives what can be taken
    hold of: viser's handles of meshes that have many copies, and of which geom each copy is.
    """

    def __init__(self, grips: Callable[[], Sequence[tuple[Any, np.ndarray]]]) -> None:
        self._grips = grips
        self._held: list[Any] = []

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Remember whom to push."""
        self._server, self._session = server, session

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Take hold of meshes that are new."""
        del snapshot
        for handle, geoms in self._grips():
            if not any(handle is known for known in self._held):
                self._held.append(handle)
                self._hold(handle, geoms, pose.size)

    def _hold(self, handle: Any, geoms: np.ndarray, size: float) -> None:
        from motorgrad.sim.live import Push

        model: Any = self._session.model
        bodies = [int(model.geom_bodyid[geom]) for geom in geoms]
        names = [model.body(body).name if model.body_weldid[body] else "" for body in bodies]

        async def pull(event: Any) -> None:
            copy = event.instance_index or 0
            if event.phase == "end" or copy >= len(names) or not names[copy]:  # beyond is the untrained one
                return
            force = drag_force(model, event.start_position, event.end_position, size)
            try:
                self._session.order(Push(names[copy], force, HELD))
            except (ValueError, RuntimeError) as error:
                notify(self._server, str(error), client=event.client)

        handle.on_drag("left", modifier="cmd/ctrl")(pull)


def drag_force(model: Any, start: Any, end: Any, size: float) -> tuple[float, float, float]:
    """The force of a drag from a place on the body to another, in N, as of a spring; at most ten times the weight.

    **Arguments:** the model; where the body was taken hold of and where the pointer is, (3,) in m; the body's size, m.
    """
    weight = weight_of(model)
    force = PULL * weight * (np.asarray(end, float) - np.asarray(start, float)) / size
    force *= min(1.0, 10 * weight / max(float(np.linalg.norm(force)), 1e-9))
    x, y, z = force.tolist()
    return x, y, z
