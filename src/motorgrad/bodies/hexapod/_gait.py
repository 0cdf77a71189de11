"""Walking with the fixed controller, and measuring gaits: stride frequency, duty factor, and the phase between the
tripods."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's compiled modules carry no type information.)

import dataclasses
from collections.abc import Sequence
from typing import Any, NamedTuple, cast

import mujoco
import numpy as np
from jaxtyping import Bool, Float, Int

from motorgrad._errors import check, check_positive
from motorgrad.bodies._batch import BodyBatch
from motorgrad.bodies._body import Body, actuators_of
from motorgrad.bodies.hexapod._controllers import TRIPODS, TripodController
from motorgrad.bodies.hexapod._sensors import LEGS, HexapodReading, read_hexapod

TOUCH = 0.5
"""The least force in N that counts as contact; anything less is noise."""
STALLED = 0.03  # m/s
_DEBOUNCE = 0.025  # s on either side, within which the majority of the contacts counts
_PADDING = 8  # of the spectrum, so that its peak is found between the bins


class Gait(NamedTuple):
    """Measures of a gait, each of shape (seeds,). NaN is what is undefined: the phase between legs that do not move.

    - `kind`: "stalled" below 0.03 m/s; "tripod" where `phase` > 0.35 and `correlation` < −0.3; "pronk" where `phase` <
      0.15 and `correlation` > 0.3; else "intermediate".
    - `speed`: mean velocity along the heading, m/s; `net`: distance from first to last position, divided by the time,
      m/s.
    - `frequency`: frequency of strides in Hz, the spectral peak of the first tripod's mean lateral angle; NaN if that
      never changes.
    - `phase`: phase between the mean lateral angles of the two tripods at that frequency, in cycles from 0 to 0.5; NaN
      if either never changes.
    - `correlation`: correlation of these two angles, from −1 to 1; NaN if either never changes.
    - `contact_correlation`: correlation of the two tripods' numbers of feet on the ground, from −1 to 1; NaN if either
      number never changes.
    - `duty`: fraction of the time that a foot is on the ground, averaged over all six.
    """

    kind: np.ndarray
    speed: np.ndarray
    net: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray
    correlation: np.ndarray
    contact_correlation: np.ndarray
    duty: np.ndarray


@dataclasses.dataclass(frozen=True, eq=False)
class Walk:
    """A recorded walk of several hexapods; time leads, then seeds.

    - `time` (decisions,) in s, at the end of each decision; `period`, between two of them.
    - `states` (decisions, seeds, 6): states of the legs in each decision, as in `LegState`.
    - `reading`: a `HexapodReading` of arrays (decisions, seeds, …).
    - `posture` (decisions, seeds, nq): the positions of all joints, for films.
    - `diverged` (seeds,): how often each simulation diverged and restarted.
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
        """The gait after the first `since` seconds."""
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

    **Arguments:** a hexapod with `drive="servos"`, or a sequence of them, one per seed; the controller, by default
    `TripodController()`; simulated seconds; physics steps per decision; `threads` as in `BodyBatch`.

    **Raises:** `ValueError` for a body not driven by its twelve servos, or for less than one decision.

    ```python
    result = mg.bodies.walk(mg.bodies.Hexapod(drive="servos"), seconds=5.0)
    print(result.gait().speed)
    ```
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
    states = controller.begin(reading)
    recorded = []
    packed = []
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


def measure_gait(reading: HexapodReading, period: float) -> Gait:
    """Measure the gait of a recorded walk.

    **Arguments:** `reading`: arrays (decisions, seeds, …) of at least eight decisions, such as `Walk.reading` without
    its start; `period`: time between two decisions in s.

    **Raises:** `ValueError` for another shape or a period that is not positive.
    """
    lateral = np.asarray(reading.lateral, float)
    right = lateral.ndim == 3 and len(lateral) >= 8
    check(right, "reading.lateral.shape", lateral.shape, "(decisions, seeds, 6) with at least 8 decisions")
    check_positive("period", period)
    means = [lateral[..., [LEGS.index(leg) for leg in tripod]].mean(-1) for tripod in TRIPODS]
    first, second = (angle - angle.mean(0) for angle in means)
    window = np.hanning(len(lateral))[:, None]
    spectra = [np.fft.rfft(window * angle, _PADDING * len(lateral), axis=0) for angle in (first, second)]
    frequencies = np.fft.rfftfreq(_PADDING * len(lateral), period)
    peak = np.abs(spectra[0]).argmax(0)
    seeds = np.arange(lateral.shape[1])
    one, other = (spectrum[peak, seeds] for spectrum in spectra)
    moves, other_moves = ((np.ptp(angle, axis=0) > 0.0) for angle in (first, second))
    both = moves & other_moves
    phase = np.where(both, np.abs(np.angle(one * other.conj())) / (2.0 * np.pi), np.nan)
    power = np.sqrt((first**2).sum(0) * (second**2).sum(0))
    correlation = np.divide((first * second).sum(0), power, out=np.full(len(seeds), np.nan), where=both)
    speed = np.asarray(reading.speed, float).mean(0)
    path = np.asarray(reading.position, float)[[0, -1], :, :2]
    down = debounced(np.asarray(reading.contact) > TOUCH, period)
    return Gait(
        kind=_kind(speed, phase, correlation),
        speed=speed,
        net=np.linalg.norm(path[1] - path[0], axis=-1) / (period * (len(lateral) - 1)),
        frequency=np.where(moves, frequencies[peak], np.nan),
        phase=phase,
        correlation=correlation,
        contact_correlation=_contact_correlation(down),
        duty=down.mean((0, 2)),
    )


def _contact_correlation(down: Bool[np.ndarray, "decisions seeds 6"]) -> Float[np.ndarray, " seeds"]:
    """Correlation of the tripods' numbers of feet on the ground."""
    counts = np.stack([down[..., [LEGS.index(leg) for leg in tripod]].sum(-1) for tripod in TRIPODS])
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.array([np.corrcoef(each)[0, 1] for each in np.moveaxis(counts, 2, 0)])


def debounced(contact: np.ndarray, period: float) -> np.ndarray:
    """Remove contacts and gaps shorter than 25 ms from contacts (decisions, …), by majority within a window of that
    length on either side. `period` is the time between two decisions in s."""
    if not len(contact):
        return contact.astype(bool)
    reach = int(_DEBOUNCE / period + 1e-9)
    padded = np.pad(contact, ((reach, reach), *((0, 0),) * (contact.ndim - 1)), mode="edge").astype(float)
    window = np.lib.stride_tricks.sliding_window_view(padded, 2 * reach + 1, axis=0)
    return window.mean(-1) > 0.5


def _kind(speed: np.ndarray, phase: np.ndarray, correlation: np.ndarray) -> np.ndarray:
    tripod = (phase > 0.35) & (correlation < -0.3)
    pronk = (phase < 0.15) & (correlation > 0.3)
    return np.select([speed < STALLED, tripod, pronk], ["stalled", "tripod", "pronk"], "intermediate")
