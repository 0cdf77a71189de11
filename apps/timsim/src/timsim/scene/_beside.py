"""Bodies side by side: each has a colour, and a label with its name and its performance."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterable, Sequence

import mujoco
import numpy as np
import viser

from timsim.live import Session
from timsim.scene._layer import Layer
from timsim.scene._pose import Pose
from timsim.scene._units import unit_of

BODY_COLOURS = (
    "#0b6bcb",
    "#d9730d",
    "#2b9348",
    "#a43ec2",
    "#c2255c",
    "#0c8599",
    "#8a6a00",
    "#5f3dc4",
    "#c92a2a",
    "#495057",
)
"""Of the bodies in view, in charts and labels; those beside the first are tinted with theirs."""
TINT = 0.4  # share of a body's colour in its tint
RATE = 2.0  # Hz of the readings in labels
SPAN = 2.0  # s of simulated time over which speed and reward are averaged


def tinted_beside(colours: np.ndarray, row: int) -> np.ndarray:
    """Colours `(n, 3)` of parts of the body in a row, tinted unless it is the first."""
    return colours if row == 0 else colours + TINT * (rgb_of_body(row) - colours)


def rgb_of_body(row: int) -> np.ndarray:
    """The colour of the body in a row, `(3,)` in [0, 1]."""
    return np.array([*bytes.fromhex(BODY_COLOURS[row % len(BODY_COLOURS)][1:])]) / 255


def main_metric(names: Iterable[str]) -> str:
    """The best measure of a body's performance: the return of episodes, else the task's first metric, else the
    reward."""
    named = [name for name in names if name != "reward"]
    return "return" if "return" in named else named[0] if named else "reward"


class Readings:
    """The performance of each body in view, in words: the task's metric, and the speed of its centre of mass."""

    def __init__(self, session: Session) -> None:
        self._session = session
        joints = [] if session.model is None else session.model.jnt_type
        self._travels = bool(np.any(np.asarray(joints) == mujoco.mjtJoint.mjJNT_FREE))
        self._past: deque[tuple[float, np.ndarray]] = deque(maxlen=600)
        self._due = 0.0
        self._words = [""]
        self._began = -1, 0

    def words(self, pose: Pose) -> list[str]:
        """One text for each body, updated twice a second; of a run that is paused, at once."""
        snapshot = pose.snapshot
        assert snapshot is not None
        began = snapshot.reset_count, len(snapshot.position)
        if began != self._began:
            self._began = began
            self._due = 0.0
            self._past.clear()
        if pose.bodies and (not self._past or snapshot.seconds > self._past[-1][0]):
            self._past.append((snapshot.seconds, pose.centres))
            while len(self._past) > 2 and self._past[1][0] <= snapshot.seconds - SPAN:
                self._past.popleft()
        if time.monotonic() >= self._due or not snapshot.playing:
            self._due = time.monotonic() + 1 / RATE
            speeds = self._speeds()
            self._words = [
                " · ".join(filter(None, [self._reading(row, snapshot.decision), speeds[row]]))
                for row in range(len(snapshot.position))
            ]
        return self._words

    def _reading(self, row: int, decision: int) -> str:
        if self._session.agent is None:
            return ""
        name = main_metric(self._session.metrics)
        curve = self._session.curve(row).until(decision)
        values = curve.values[name]
        known = values[np.isfinite(values)]
        if not len(known) or not np.isfinite(curve.reward[-1]):  # what was, before the policy broke, is no news
            return ""
        return f"{name} {known[-1]:.3g} {unit_of(name, self._session.task)}".replace("-", "−").rstrip()

    def _speeds(self) -> list[str]:
        """The speed of each centre of mass; empty if the body cannot travel, or no time has passed."""
        count = self._began[1]
        if not self._travels or len(self._past) < 2 or self._past[-1][0] - self._past[0][0] < 0.1:
            return [""] * count
        (before, start) = self._past[0]
        (now, end) = self._past[-1]
        away = np.linalg.norm((end - start)[:, :2], axis=1) / (now - before)
        return [f"{each:.2f} m/s" if np.isfinite(each) else "" for each in away]


def label_each(scene: viser.SceneApi, labels: list[viser.LabelHandle], names: Sequence[str]) -> None:
    """Add labels, or remove some, until there is one for each name."""
    while len(labels) > len(names):
        labels.pop().remove()
    for row in range(len(labels), len(names)):
        labels.append(scene.add_label(f"/labels/{row}", names[row], anchor="bottom-center"))


class Labels(Layer):
    """Labels each body with its name and performance, if there are several."""

    def build(self, server: viser.ViserServer, session: Session) -> None:
        self.applies = session.model is not None
        self._scene = server.scene
        self._readings = Readings(session)
        self._texts: list[viser.LabelHandle] = []

    def renew(self, pose: Pose) -> int:
        """The last words while it plays are older than the moment at which it is paused."""
        assert pose.snapshot is not None
        return int(pose.snapshot.playing)

    def draw(self, pose: Pose) -> None:
        assert pose.snapshot is not None
        names = pose.snapshot.labels if len(pose.bodies) > 1 else ()
        label_each(self._scene, self._texts, names)
        if not names:
            return
        readings = self._readings.words(pose)
        for row, (label, data, offset) in enumerate(zip(self._texts, pose.bodies, pose.offset, strict=False)):
            words = f"{names[row]}: {readings[row]}" if readings[row] else names[row]
            if label.text != words:
                label.text = words
            # one above the other in turn, so that long ones do not overlap
            up = (0.5 + 0.14 * (row % 2) * (len(names) > 2)) * pose.size
            label.position = data.subtree_com[0] + offset + (0.0, 0.0, up)
