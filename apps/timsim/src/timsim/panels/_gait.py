"""The gait of a hexapod: footfall diagram, gait class, speed, phases and duty factor."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import mujoco
import numpy as np
import viser

from motorgrad.bodies import (
    LEGS,
    TOUCH,
    TRIPODS,
    BodyState,
    Gait,
    HexapodReading,
    debounced,
    install_muscle_callback,
    measure_gait,
    read_hexapod,
)
from timsim.live import Session, Snapshot, Trail
from timsim.panels import _charts
from timsim.panels._panel import Numbers, Panel, brief, table
from timsim.scene import Pose

SECONDS = 4.0
ROW = 19.0
# colours of the two tripods
FIRST = "#3b6fb6"
SECOND = "#c8452f"


def draw_footfall(
    seconds: np.ndarray, contact: np.ndarray, names: Sequence[str], tripod: Sequence[bool], period: float, now: float
) -> str:
    """The footfalls of the last seconds as SVG: a bar for each leg while its foot is on the ground.

    **Arguments:** `seconds` `(n,)` at which `contact` `(n, legs)` begins; `names` of the legs from above; `tripod`:
    whether each is in the first tripod; `period` of a decision in s; `now`: the moment shown, in s.
    """
    end = (float(seconds[-1]) if len(seconds) else 0.0) + period
    count = len(names)
    box = (86.0, 6.0, _charts.WIDTH - 8, 6 + ROW * count)
    words = _charts.time_before(end - period, now, period)
    chart = _charts.Chart((-SECONDS, 0.0), (0.0, float(count)), words, "", box, [*reversed(names)])
    recent = seconds >= end - SECONDS - period
    time = seconds[recent] - end
    touching = contact[recent]
    for leg in range(count):
        row = count - 1 - leg
        for start, stop in _stretches(time, touching[:, leg], period):
            chart.bar(start, stop, row + 0.16, row + 0.84, FIRST if tripod[leg] else SECOND)
    parts = chart.elements()
    low = box[3] + 38
    parts += [
        _charts.text(86, low, "▬ first tripod", extra=f'style="fill:{FIRST}"'),
        _charts.text(176, low, "▬ second tripod", extra=f'style="fill:{SECOND}"'),
    ]
    return _charts.document(_charts.WIDTH, low + 8, parts, "footfall diagram")


def _stretches(time: np.ndarray, touching: np.ndarray, period: float) -> list[tuple[float, float]]:
    """The intervals in which a foot is on the ground, without gaps in the samples."""
    if not len(time):
        return []
    gap = np.concatenate([[True], np.diff(time) > 1.5 * period])
    group = np.cumsum(gap | np.concatenate([[True], touching[1:] != touching[:-1]]))
    found = []
    for number in np.unique(group[touching.astype(bool)]):
        rows = np.flatnonzero(group == number)
        found.append((float(time[rows[0]]), float(time[rows[-1]]) + period))
    return found


MIN_GAIT_SECONDS = 2.0  # in which a gait is measured


def is_hexapod(model: mujoco.MjModel | None) -> bool:
    """Whether a model has the sensors for measuring a gait."""
    if model is None:
        return False
    known = {model.sensor(index).name for index in range(model.nsensor)}
    wanted = {f"{kind}_{leg}" for kind in ("lateral", "vertical", "contact") for leg in LEGS}
    return known >= wanted | {"position", "forward", "velocity", "rotation", "upward"}


class GaitReader:
    """Measures the gait of the last decisions; the sensors of each decision are computed once from its state.

    **Arguments:** `model`; `period` of a decision in s; `feet`: names of a trail's contacts.
    """

    def __init__(self, model: mujoco.MjModel, period: float, feet: list[str]) -> None:
        install_muscle_callback(model)
        self._model = model
        self._data = mujoco.MjData(model)
        self._period = period
        self._feet = [feet.index(f"contact_{leg}") for leg in LEGS]
        self._known: dict[int, np.ndarray] = {}

    def contacts(self, trail: Trail) -> np.ndarray:
        """Which feet are on the ground, `(n, 6)`, legs in the order of `motorgrad.bodies.LEGS`."""
        return debounced(trail.contacts[:, self._feet] > TOUCH, self._period)

    def gait(self, trail: Trail) -> Gait | None:
        """The gait of the last uninterrupted stretch; None if it is too short."""
        breaks = np.flatnonzero((np.diff(trail.decision) != 1) | (np.diff(trail.seconds) <= 0)) + 1
        first = int(breaks[-1]) if len(breaks) else 0
        if (len(trail.decision) - first) * self._period < MIN_GAIT_SECONDS:
            return None
        return measure_gait(self._reading(trail, first), self._period)

    def _reading(self, trail: Trail, first: int) -> HexapodReading:
        rows = range(first, len(trail.decision))
        sensed = {row: self._sensed(trail, row) for row in rows}
        self._known = {int(trail.decision[row]): values for row, values in sensed.items()}
        table = np.stack([sensed[row] for row in rows])[:, None]  # one seed
        sensors: dict[str, Any] = {}
        for index in range(self._model.nsensor):
            sensor = self._model.sensor(index)
            start = int(sensor.adr[0])
            size = int(sensor.dim[0])
            sensors[sensor.name] = table[..., start] if size == 1 else table[..., start : start + size]
        state = BodyState(trail.position[first:, None], trail.velocity[first:, None], sensors)
        return read_hexapod(state)._replace(contact=trail.contacts[first:, None, self._feet])

    def _sensed(self, trail: Trail, row: int) -> np.ndarray:
        """The sensors that positions and velocities determine."""
        kept = self._known.get(int(trail.decision[row]))
        if kept is not None:
            return kept
        self._data.qpos[:] = trail.position[row]
        self._data.qvel[:] = trail.velocity[row]
        mujoco.mj_step1(self._model, self._data)
        return self._data.sensordata.copy()


class GaitPanel(Panel):
    """Footfall diagram; gait class, speed, phase between the tripods, stride frequency, duty factor."""

    title: ClassVar[str] = "Gait"
    rate: ClassVar[float] = 2.0

    @classmethod
    def applies(cls, session: Session) -> bool:
        return is_hexapod(session.model) and {f"contact_{leg}" for leg in LEGS} <= set(session.feet)

    def fill(self, gui: viser.GuiApi) -> None:
        self._summary = gui.add_html("")
        self._diagram = gui.add_html("")
        self._reader = GaitReader(self.model, self.session.period, self.session.feet)

    def show(self, snapshot: Snapshot, pose: Pose) -> None:
        del pose
        trail = self.session.trail()
        period = self.session.period
        names = [leg.replace("_", " ") for leg in LEGS]
        first = [leg in TRIPODS[0] for leg in LEGS]
        contact = self._reader.contacts(trail)
        self._diagram.content = draw_footfall(trail.seconds, contact, names, first, period, snapshot.seconds)
        gait = self._reader.gait(trail)
        if gait is None:
            self._summary.content = table([("gait", "unknown: too few decisions in a row")])
            return
        self._summary.content = table(
            [
                ("measured up to", f"{trail.seconds[-1]:,.2f} s"),
                ("gait", str(gait.kind[0])),
                ("speed", f"{brief(float(gait.speed[0]))} m/s"),
                ("phase between tripods", f"{brief(float(gait.phase[0]), 2)} of a cycle"),
                ("correlation of tripods", brief(float(gait.correlation[0]), 2)),
                ("correlation of their contacts", brief(float(gait.contact_correlation[0]), 2)),
                ("stride frequency", f"{brief(float(gait.frequency[0]))} Hz"),
                ("duty factor", f"{float(gait.duty[0]):.0%}"),
            ]
        )

    def numbers(self) -> Numbers:
        trail = self.session.trail()
        contact = self._reader.contacts(trail)
        touching = {f"on the ground {leg}": column for leg, column in zip(LEGS, contact.astype(int).T, strict=True)}
        force = {
            f"force {name} (N)": np.asarray(row) for name, row in zip(self.session.feet, trail.contacts.T, strict=True)
        }
        return {"decision": trail.decision, "seconds": trail.seconds, **touching, **force}
