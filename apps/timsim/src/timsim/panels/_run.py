"""The run: play, pause, single decisions, speed, going back in time, and pushes."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, ClassVar

import mujoco
import numpy as np
import numpy.typing as npt
import viser

from timsim.live import Pause, Play, Push, Reset, Scrub, Session, Snapshot, Speed, Step, Undo
from timsim.panels._branches import BranchFolder
from timsim.panels._panel import Following, Numbers, Panel, brief, columns_of, command, notify, table
from timsim.scene import Pose

DIRECTIONS = {
    "+x": (1.0, 0.0, 0.0),
    "−x": (-1.0, 0.0, 0.0),
    "+y": (0.0, 1.0, 0.0),
    "−y": (0.0, -1.0, 0.0),
    "up": (0.0, 0.0, 1.0),
    "down": (0.0, 0.0, -1.0),
}
PULL = 5.0  # force of a drag by the size of the body, in weights of the body
SHARE = 0.5  # initial force of a push, in weights of the body
PULL_SECONDS = 0.1  # duration of a pull, unless the drag goes on


class PushFolder:
    """A folder to push a part of the body: which part, direction, force and duration.

    **Arguments:** `panel`: that it belongs to.
    """

    def __init__(self, panel: Panel) -> None:
        self._panel = panel

    def fill(self, gui: viser.GuiApi) -> None:
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
            self._way = gui.add_dropdown("Direction", (*DIRECTIONS,), initial_value=first, hint="In world coordinates.")
            strength = float(f"{SHARE * weight:.1g}")
            self._strength = gui.add_number("Force (N)", strength, min=0.0, step=strength / 10)
            self._seconds = gui.add_number("For (s)", 0.1, min=0.01, max=60.0, step=0.01)
            button = gui.add_button("Push", icon=viser.Icon.HAND_FINGER)
            button.on_click(self._panel.guarded(self._push))
        command(gui, "Push", "P", self._panel.guarded(self._push))

    def _push(self, _: viser.GuiEvent) -> None:
        x, y, z = (self._strength.value * part for part in DIRECTIONS[self._way.value])
        self._panel.order(Push(self._body.value, (x, y, z), self._seconds.value))


def movable(model: mujoco.MjModel, part: str) -> str:
    """The first direction in which a part can move at the start; some bodies cannot move in all directions."""
    data = mujoco.MjData(model)
    if model.nkey:
        mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_fwdPosition(model, data)
    shifts = np.zeros((3, model.nv))
    mujoco.mj_jacBodyCom(model, data, shifts, None, model.body(part).id)
    free = [name for name, way in DIRECTIONS.items() if np.abs(way @ shifts).max(initial=0.0) > 1e-6]
    return free[0] if free else next(iter(DIRECTIONS))


def weight_of(model: mujoco.MjModel) -> float:
    """The weight of everything that moves, in N; 1 without mass."""
    moving = np.asarray(model.body_weldid) != 0
    pull = float(np.linalg.norm(model.opt.gravity)) or 9.81
    return float(np.sum(model.body_mass[moving])) * pull or 1.0


class DragPush:
    """Pulls a part of the body towards the pointer while the user drags it with Ctrl (or Cmd).

    It is a part of the page, updated after the scene.

    **Arguments:** `draggable`: a function that returns viser's handles of batched meshes, and the geom of each of their
    copies.
    """

    def __init__(self, draggable: Callable[[], Sequence[tuple[Any, np.ndarray]]]) -> None:
        self._draggable = draggable
        self._held: dict[int, Any] = {}

    def build(self, server: viser.ViserServer, session: Session) -> None:
        """Remember the session."""
        self._server, self._session = server, session

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        """Listen to new meshes."""
        del snapshot
        for handle, geoms in self._draggable():
            if id(handle) not in self._held:
                self._held[id(handle)] = handle
                self._hold(handle, geoms, pose.size)

    def _hold(self, handle: viser.SceneNodeHandle, geoms: np.ndarray, size: float) -> None:
        model: Any = self._session.model
        bodies = [int(model.geom_bodyid[geom]) for geom in geoms]
        names = [model.body(body).name if model.body_weldid[body] else "" for body in bodies]

        async def pull(event: viser.SceneNodeDragEvent) -> None:
            copy = event.instance_index or 0
            if event.phase == "end" or copy >= len(names) or not names[copy]:  # beyond: the untrained body
                return
            force = drag_force(model, event.start_position, event.end_position, size)
            try:
                self._session.order(Push(names[copy], force, PULL_SECONDS))
            except (ValueError, RuntimeError) as error:
                notify(self._server, str(error), client=event.client)

        handle.on_drag("left", modifier="cmd/ctrl")(pull)


def drag_force(
    model: mujoco.MjModel, start: npt.ArrayLike, end: npt.ArrayLike, size: float
) -> tuple[float, float, float]:
    """The force of a drag in N, as of a spring, at most ten times the weight.

    **Arguments:** `model`; `start`: where the body was grabbed, and `end`: where the pointer is, (3,) in m; `size` of
    the body in m.
    """
    weight = weight_of(model)
    force = PULL * weight * (np.asarray(end, float) - np.asarray(start, float)) / size
    force *= min(1.0, 10 * weight / max(float(np.linalg.norm(force)), 1e-9))
    x, y, z = force.tolist()
    return x, y, z


MARKS = (0.05, 0.2, 1.0, 5.0, 20.0)
MAX_SLIDER_SPEED = 60.0
"""Its right end, beyond it, is as fast as possible."""


class RunPanel(Panel):
    """Play, pause, single decisions, reset, speed, going back in time, and pushes."""

    title: ClassVar[str] = "Run"
    rate: ClassVar[float] = 8.0

    def fill(self, gui: viser.GuiApi) -> None:
        self._summary = gui.add_html("")
        buttons = gui.add_button_group(
            "Run", ("Play", "Pause", "Step"), hint="Keys: space plays and pauses, N makes one decision."
        )
        buttons.on_click(self.guarded(lambda event: self._press(event.target.value)))
        self._speed = gui.add_multi_slider(
            "Speed",
            min=math.log10(MARKS[0]),
            max=math.log10(MAX_SLIDER_SPEED),
            step=0.01,
            initial_value=(self._place(self.session.speed),),
            marks=(*((math.log10(mark), f"{mark:g}×") for mark in MARKS), (math.log10(MAX_SLIDER_SPEED), "max")),
            hint="Simulated seconds per second; the right end is as fast as possible.",
        )
        self._speed.on_update(self.guarded(self._set_speed))
        with gui.add_folder("Back in time"):
            self._back = gui.add_slider(
                "To (s)",
                min=-1.0,
                max=0.0,
                step=self._step,
                initial_value=0.0,
                hint="Restores body and learner. What followed is kept, as a branch where something is changed.",
            )
            self._back.on_update(self._scrub)
            go = gui.add_button("Continue from here", icon=viser.Icon.PLAYER_PLAY)
            go.on_click(self.guarded(lambda _: self._press("Play")))
        self._branches = BranchFolder(self)
        self._branches.fill(gui)
        self._undo = gui.add_button(
            "Undo the last change",
            icon=viser.Icon.ARROW_BACK_UP,
            color="gray",
            hint="Goes back to before the last push or edit. Key: U.",
        )
        self._undo.on_click(self.guarded(lambda _: self.order(Undo())))
        reset = gui.add_button(
            "Reset", icon=viser.Icon.ROTATE_2, color="gray", hint="Returns body and learner to the start."
        )
        reset.on_click(self.guarded(lambda _: self._press("Reset")))
        self._following_speed = Following(self._speed)
        self._following_past = Following(self._back)
        self._wanted: tuple[float, Any] | None = None
        self._limits = (-1.0, 0.0)
        self._push = PushFolder(self) if self.model is not None else None
        if self._push is not None:
            self._push.fill(gui)
        for label, key, action in (
            ("Play or pause", "space", lambda _: self._press("Pause" if self.session.snapshot().playing else "Play")),
            ("One decision", "N", lambda _: self.order(Step())),
            ("Undo the last change", "U", lambda _: self.order(Undo())),
        ):
            command(gui, label, key, self.guarded(action))

    def update(self, snapshot: Snapshot, pose: Pose) -> None:
        if self._wanted is not None:  # at most once a frame, however fast the slider moves
            wanted = self._wanted
            self._wanted = None
            self.guarded(lambda _: self._go_to(*wanted))(wanted[1])
        super().update(snapshot, pose)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del pose
        doing = "paused" if not snapshot.playing else "acting, learning frozen" if snapshot.frozen else "running"
        if snapshot.playing and not snapshot.frozen and self.session.agent is not None:
            doing = "learning"
        rows = [
            ("state", doing),
            ("simulated time", f"{snapshot.seconds:,.2f} s"),
            ("decisions", f"{snapshot.decision:,}"),
            ("speed", f"{brief(snapshot.speed)}×" if snapshot.playing else "–"),
        ]
        self._summary.content = table(rows)
        self._branches.show()
        pace = round(self._place(self.session.speed), 2)
        if abs(self._speed.value[0] - pace) > 0.02:  # set from Python or by another browser
            self._following_speed.show((pace,))
        low = min(-self._step, (snapshot.oldest - snapshot.newest) * self.session.period)
        if not math.isclose(low, self._limits[0]) and not self._following_past.is_moved:
            self._limits = (low, 0.0)
            self._back.min = low
        place = (snapshot.decision - snapshot.newest) * self.session.period
        self._following_past.show(float(np.clip(place, self._limits[0], 0)))

    def numbers(self) -> Numbers:
        trail = self.session.trail()
        return {
            "decision": trail.decision,
            "seconds": trail.seconds,
            **columns_of("position", [str(i) for i in range(trail.position.shape[1])], trail.position),
            **columns_of("velocity", [str(i) for i in range(trail.velocity.shape[1])], trail.velocity),
        }

    @property
    def _step(self) -> float:
        return max(self.session.period, 1e-3)

    @staticmethod
    def _place(speed: float) -> float:
        return math.log10(min(speed, MAX_SLIDER_SPEED))

    def _press(self, button: str) -> None:
        self.order({"Play": Play, "Pause": Pause, "Step": Step, "Reset": Reset}[button]())

    def _set_speed(self, event: viser.GuiEvent) -> None:
        if event.client is None:  # this panel itself
            return
        self._following_speed.moved()
        factor = 10 ** event.target.value[0]
        self.order(Speed(math.inf if factor > MAX_SLIDER_SPEED * 0.97 else max(factor, MARKS[0])))

    def _scrub(self, event: viser.GuiEvent) -> None:
        if event.client is not None:  # not by this panel itself
            self._following_past.moved()
            self._wanted = (float(event.target.value), event)

    def _go_to(self, seconds: float, event: viser.GuiEvent) -> None:
        del event
        now = self.session.snapshot()
        decision = now.newest + round(seconds / self.session.period)
        self.order(Scrub(int(np.clip(decision, now.oldest, now.newest))))
