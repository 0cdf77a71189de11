"""Muscles: activation over time, and the operating point of one on its force–length–velocity curves."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar, NamedTuple

import mujoco
import numpy as np
import viser

from motorgrad._errors import counted
from timsim.film import muscle_colour
from timsim.live import MUSCLE_FIELDS, Event, Session, Snapshot, field_of, owned
from timsim.panels import _charts
from timsim.panels._charts import FAINT, STRONG
from timsim.panels._drive import DriveFolder, MuscleFinder
from timsim.panels._muscle_law import Law
from timsim.panels._panel import Numbers, Panel, brief, columns_of, table
from timsim.panels._settings_form import SettingsForm
from timsim.scene import Pose

SECONDS = 4.0
COLUMNS = 320
ROW = 15.0
LOW = 216.0
"""Height of a row, and of all rows where there are many, in the diagram's units."""


def draw_raster(
    seconds: np.ndarray, level: np.ndarray, names: Sequence[str], period: float, now: float, chosen: int = -1
) -> str:
    """The activations of the last seconds as SVG: the stronger the red, the more active; blank where the run was not
    sampled.

    **Arguments:** `seconds` `(n,)` at which `level` `(n, muscles)`, in [0, 1], begins; `names` of the muscles; `period`
    of a decision in s; `now`: the moment shown, in s; `chosen`: the row to mark.
    """
    count = len(names)
    row = min(ROW, max(LOW / count, 2.5))
    named = row >= 7
    left = 12 + min(124.0, 0.53 * min(row, _charts.SIZE) * max(map(len, names), default=0)) if named else 30.0
    end = (seconds[-1] if len(seconds) else 0.0) + period
    start = end - SECONDS
    box = (left, 6.0, _charts.WIDTH - 8, 6 + row * count)
    side = "" if named else f"{counted(count, 'muscle')}, the first at the top"
    labels = [*reversed(names)] if named else [""]
    words = _charts.time_before(end - period, now, period)
    chart = _charts.Chart((start - end, 0.0), (0.0, float(count)), words, side, box, labels, min(row, 10.5))
    chart.image(_pixels(seconds, level, start, end, period))
    if 0 <= chosen < count:
        height = float(count - chosen)
        edge = np.array([height, height])
        span = np.array([start - end, 0.0])
        for side in (edge, edge - 1):
            chart.line(span, side, _charts.INK, 0.8, 'stroke-opacity=".8"')
    return _charts.document(_charts.WIDTH, box[3] + 30, chart.elements(), "activation of the muscles over time")


def _pixels(seconds: np.ndarray, level: np.ndarray, start: float, end: float, period: float) -> np.ndarray:
    """Colours `(muscles, COLUMNS, 4)` of the last level before each column, if that is recent."""
    at = start + (np.arange(COLUMNS) + 0.5) / COLUMNS * (end - start)
    row = np.searchsorted(seconds, at, side="right") - 1
    known = (row >= 0) & (at - seconds[np.maximum(row, 0)] <= 1.5 * period) if len(seconds) else np.zeros(COLUMNS, bool)
    shown = np.clip(level[np.maximum(row, 0)], 0, 1) if len(seconds) else np.zeros((COLUMNS, level.shape[1]))
    colour = muscle_colour(shown.T.ravel()).reshape(level.shape[1], COLUMNS, 3)
    strength = np.where(known, 0.10 + 0.90 * shown.T, 0.0)
    return np.round(255 * np.concatenate([colour, strength[..., None]], axis=2)).astype(np.uint8)


POINTS = 61
MIN_VELOCITY_RANGE = 0.1  # m/s
HALF = (34.0, 8.0, 164.0, 140.0)
OTHER = (210.0, 8.0, _charts.WIDTH - 8, 140.0)
HERE = "#d0021b"


class Range(NamedTuple):
    """The limits of both curves, which widen with the muscle's motion."""

    length: tuple[float, float]
    speed: float

    def holding(self, length: float, velocity: float, rest: float) -> Range:
        """The range, widened to contain the current moment."""
        if np.isfinite(rest):
            low = min(self.length[0], 0.4 * rest)
            high = max(self.length[1], 1.6 * rest)
        else:
            low, high = self.length
        room = 0.1 * abs(length) + 1e-3  # an actuator without a path may have a negative length
        low = min(low, length - room)
        high = max(high, length + room)
        return Range((low, high), max(self.speed, 1.15 * abs(velocity), MIN_VELOCITY_RANGE))


def draw_operating(
    law: Law,
    activation: float,
    length: float,
    velocity: float,
    where: Range,
    now: float,
    units: tuple[str, str] = ("m", "N"),
) -> str:
    """Force against length and against velocity as SVG: faint at full activation, strong at the present one, with the
    operating point at the force `now`. `units` are those of length and of force. While a tendon changes its length, the
    point leaves the curves of a Hill-type muscle.
    """
    lengths = np.linspace(*where.length, POINTS)
    speeds = np.linspace(-where.speed, where.speed, POINTS)
    still = np.zeros(POINTS)
    along = [law.force(a, lengths, still + velocity) for a in (1.0, activation)]
    across = [law.force(a, still + length, speeds) for a in (1.0, activation)]
    every = np.concatenate([*along, *across, [0.0, now]])
    room = 0.06 * max(float(np.ptp(every)), 1e-9)
    up = (float(every.min()) - room, float(every.max()) + room)
    parts: list[str] = []
    for x, curves, here, words, box, side in (
        (lengths, along, length, f"length ({units[0]})", HALF, f"force ({units[1]})"),
        (speeds, across, velocity, f"velocity ({units[0]}/s)", OTHER, ""),
    ):
        chart = _charts.Chart((float(x[0]), float(x[-1])), up, words, side, (box[0] + 12, *box[1:]) if side else box)
        chart.line(np.array([x[0], x[-1]]), np.zeros(2), _charts.INK, 0.6, 'stroke-opacity=".4"')
        chart.line(x, curves[0], FAINT, 1.6)
        chart.line(x, curves[1], STRONG, 2.0)
        chart.dot(here, now, HERE)
        parts += chart.elements()
    parts.append(_charts.text(46, 180, "— full activation", extra=f'style="fill:{FAINT}"'))
    parts.append(_charts.text(136, 180, f"— present activation ({activation:.0%})", extra=f'style="fill:{STRONG}"'))
    return _charts.document(_charts.WIDTH, 190, parts, "force against length and against velocity")


def units_of(model: mujoco.MjModel, actuator: int) -> tuple[str, str]:
    """The units of an actuator's length and force: of a path m and N, about a hinge rad and N·m."""
    # NumPy's integers are in no tuple of MuJoCo's enumerations
    kind = int(model.actuator_trntype[actuator])
    of = int(model.actuator_trnid[actuator, 0])
    if kind in (mujoco.mjtTrn.mjTRN_JOINT, mujoco.mjtTrn.mjTRN_JOINTINPARENT):
        turns = int(model.jnt_type[of]) in (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_BALL)
        return ("rad", "N·m") if turns else ("m", "N")
    return "m", "N"


SHOWN = 40
"""Muscles in the diagram of activations at a time."""
ARMS = 3  # joints whose moment arm is shown


class MusclesPanel(Panel):
    """Activations over time; length, velocity, force, moment arms, operating point and settings of one muscle."""

    title: ClassVar[str] = "Muscles"
    rate: ClassVar[float] = 5.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return session.model is not None and bool(session.muscles)

    def fill(self, gui: viser.GuiApi) -> None:
        session = self.session
        self._pose: Pose | None = None
        self._finder = MuscleFinder(self, self._levels)
        self._finder.fill(gui)
        self._raster = gui.add_html("")
        self._which = gui.add_dropdown("Muscle", tuple(session.muscles), initial_value=session.muscles[0])
        self._summary = gui.add_html("")
        self._curve = gui.add_html("")
        self._range = _fresh()
        self._form = SettingsForm(self, "Settings of this muscle")
        self._editable = any(self._settings_of(name) for name in session.muscles)
        if self._editable:
            first = max(session.muscles, key=lambda name: len(self._settings_of(name)))
            self._form.fill(gui, self._settings_of(first))
            self._form.point_at(self._settings_of(self._which.value))
        self._drive = DriveFolder(self, self._finder, lambda: self._chosen) if session.task is None else None
        if self._drive is not None and session.setup.motion is None:
            self._drive.fill(gui)
        self._which.on_update(self._select)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        self._pose = pose
        trail = self.session.trail()
        row = self._chosen
        rows = self._finder.rows()
        names = self.session.muscles
        options = tuple(names[each] for each in rows) or tuple(names)
        if options != self._which.options and (self._which.value in options or self._finder.narrowed):
            self._which.options = options  # which chooses the first where the present one is not among them
            row = self._chosen
        seen = rows[:SHOWN]
        mark = seen.index(row) if row in seen else -1
        level = self._share(trail.activation)[:, seen]
        named = [names[each] for each in seen]
        shown = draw_raster(trail.seconds, level, named, self.session.period, snapshot.seconds, mark) if seen else ""
        self._raster.content = shown + self._finder.note(len(seen))
        if not pose.bodies:
            return
        data = pose.bodies[0]
        law = Law(self.model, row)
        length = float(data.actuator_length[row])
        velocity = float(data.actuator_velocity[row])
        activation = float(pose.activation[0, row])
        arms = [(f"moment arm, {arm.joint}", f"{brief(1e3 * arm.metres)} mm") for arm in law.moment_arms(data)[:ARMS]]
        (unit, of_force) = units_of(self.model, row)
        hill = law.hill_now(data)
        inside = []
        if hill is not None:
            share = f"{hill.fiber_length / law.optimal:.0%} of the optimal"
            inside = [
                ("fiber", f"{brief(1e3 * hill.fiber_length)} mm, {share}"),
                ("tendon", f"{brief(1e3 * hill.tendon_length)} mm, strain {hill.tendon_strain:.1%}"),
            ]
        force = law.force_now(data)
        self._summary.content = table(
            [
                ("activation", f"{activation:.0%}"),
                ("length", f"{brief(length)} {unit}"),
                ("velocity", f"{brief(velocity)} {unit}/s"),
                ("force", f"{brief(force)} {of_force}"),
                *inside,
                *arms,
            ]
        )
        self._range = self._range.holding(length, velocity, law.rest_length)
        units = unit, of_force
        self._curve.content = draw_operating(law, activation, length, velocity, self._range, force, units)
        if self._editable:
            self._form.refresh()

    def tell(self, events: list[Event]) -> None:
        if self._editable and any(event.kind == "error" for event in events):
            self._form.refused()

    def numbers(self) -> Numbers:
        trail = self.session.trail()
        actions = columns_of("chosen", self.session.actions, trail.action)
        levels = columns_of("activation", self.session.muscles, trail.activation)
        return {"decision": trail.decision, "seconds": trail.seconds, **levels, **actions}

    @property
    def _chosen(self) -> int:
        return self.session.muscles.index(self._which.value)

    def _share(self, activation: np.ndarray) -> np.ndarray:
        """Activations as shares of their maximum."""
        model = self.model
        most = np.abs(model.actuator_ctrlrange).max(axis=1)
        return np.abs(activation) / np.where((model.actuator_ctrllimited > 0) & (most > 0), most, 1.0)

    def _settings_of(self, muscle: str) -> list[str]:
        return [name for name in owned(self.session.settings, muscle) if field_of(name) in MUSCLE_FIELDS]

    def choose(self, muscle: str) -> None:
        """Choose a muscle by its name."""
        self._which.value = muscle

    def _select(self, _: viser.GuiEvent) -> None:
        self._range = _fresh()
        if self._editable:
            self._form.point_at(self._settings_of(self._which.value))
        if self._drive is not None:
            self._drive.follow()
        self.renew()

    def _levels(self, force: bool) -> np.ndarray:
        """The forces in N or N·m, or the activations, of all actuators `(nu,)`."""
        pose = self._pose
        if pose is None or not pose.bodies:
            return np.zeros(len(self.session.muscles))
        return pose.bodies[0].actuator_force if force else pose.activation[0]


def _fresh() -> Range:
    return Range((np.inf, -np.inf), MIN_VELOCITY_RANGE)
