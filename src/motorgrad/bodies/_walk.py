"""Walking with the fixed controller, and what is recorded of it."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
from collections.abc import Sequence
from typing import Any, cast

import mujoco
import numpy as np
from jaxtyping import Float, Int

from motorgrad._errors import check
from motorgrad.bodies._batch import BodyBatch
from motorgrad.bodies._body import Body, actuators_of
from motorgrad.bodies._gait import Gait, measure_gait
from motorgrad.bodies._hexapod_sensors import LEGS, HexapodReading, read_hexapod
from motorgrad.bodies._tripod import TripodController


@dataclasses.dataclass(frozen=True, eq=False)
class Walk:
    """A recorded walk of several hexapods; time leads, then seeds.

    - `time` (decisions,) in s, of the instants after each decision; `period`, between two of them.
    - `states` (decisions, seeds, 6): of the legs in the decision just made, as in `LegState`.
    - `reading`: a `HexapodReading` of arrays (decisions, seeds, …).
    - `posture` (decisions, seeds, nq): the positions of all joints, for films.
    - `diverged` (seeds,): how often each simulation diverged and began again.
    - `models`: the MuJoCo model of each seed.
    """

    time: Float[np.ndarray, " decisions"]
    period: float
    states: Int[np.ndarray, "decisions seeds 6"]
    reading: HexapodReading
    posture: Float[np.ndarray, "decisions seeds nq"]
    diverged: Int[np.ndarray, " seeds"]
    models: tuple[mujoco.MjModel, ...]

    def gait(self, since: float = 2.0) -> Gait:
        """The gait from `since` seconds on, when the start is over."""
        late = self.time > since
        return measure_gait(HexapodReading(*(part[late] for part in self.reading)), self.period)


def walk(
    bodies: Body | Sequence[Body],
    controller: TripodController | None = None,
    seconds: float = 10.0,
    substeps: int = 4,
    threads: int = 0,
) -> Walk:
    """Let hexapods walk from their start pose under the fixed controller.

    **Arguments:** a hexapod with `drive="servos"`, or on terrain one for each seed; the controller, by default the
    usual one; simulated seconds; physics steps of a decision; `threads` as in `BodyBatch`.

    **Raises:** `ValueError` for a body that its twelve servos do not drive, or fewer seconds than one decision.
    """
    each = tuple(bodies) if isinstance(bodies, Sequence) else (cast(Any, bodies),)
    controller = controller or TripodController()
    wanted = [f"{freedom}_{leg}" for freedom in ("lateral", "vertical") for leg in LEGS]
    for body in each:
        driven = [actuator.name for actuator in actuators_of(body)]
        check(driven == wanted, "actuators of the body", driven, 'those of a Hexapod(drive="servos")')
    batch = BodyBatch(each, len(each), substeps, threads)
    decisions = round(seconds / batch.period)
    check(decisions >= 1, "seconds", seconds, f"at least one decision, {batch.period:g} s")
    lowest = np.array([[model.joint(f"vertical_{leg}").range[0] for leg in LEGS] for model in batch.models])
    reading = read_hexapod(batch.unpack(batch.packed))
    states, recorded, packed = controller.begin(reading), [], []
    for _ in range(decisions):
        states = controller.decide(states, reading, lowest)
        batch.step(controller.velocities(states))
        packed.append(batch.packed.copy())
        reading = read_hexapod(batch.unpack(packed[-1]))
        if batch.lost:
            states = np.where(batch.packed[:, -1:] > 0, controller.begin(reading), states)
        recorded.append(states)
    state = batch.unpack(np.stack(packed))
    time = batch.period * np.arange(1, decisions + 1)
    return Walk(
        time=time,
        period=batch.period,
        states=np.stack(recorded),
        reading=read_hexapod(state),
        posture=np.asarray(state.position),
        diverged=batch.diverged.copy(),
        models=batch.models,
    )
