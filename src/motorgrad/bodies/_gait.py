"""What gait a hexapod walks in: stride frequency, duty factor, and how the two tripods stand to each other."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.bodies._hexapod_sensors import LEGS, HexapodReading
from motorgrad.bodies._muscle import positive
from motorgrad.bodies._tripod import TRIPODS

TOUCH = 0.5
"""The least force, in N, that counts as contact; less is noise."""
STALLED = 0.03  # m/s
_DEBOUNCE = 0.025  # s on either side, within which the majority of the contacts counts
_PADDING = 8  # of the spectrum, so that its peak is found between the bins


class Gait(NamedTuple):
    """Measures of a gait, for each seed (seeds,).

    - `kind`: "stalled" below 0.03 m/s; "tripod" where `phase` > 0.35 and `correlation` < −0.3; "pronk" where `phase`
      < 0.15 and `correlation` > 0.3; else "intermediate".
    - `speed`: mean velocity along the heading, m/s; `net`: distance from first to last position over the time, m/s.
    - `frequency`: of strides in Hz, the peak of the spectrum of the first tripod's mean lateral angle.
    - `phase`: between the two tripods' mean lateral angles at that frequency, in cycles from 0 to 0.5.
    - `correlation`: of these two angles, from −1 to 1.
    - `duty`: part of the time in which a foot is on the ground, the mean of all six.
    """

    kind: np.ndarray
    speed: np.ndarray
    net: np.ndarray
    frequency: np.ndarray
    phase: np.ndarray
    correlation: np.ndarray
    duty: np.ndarray


def measure_gait(reading: HexapodReading, period: float) -> Gait:
    """Measure the gait of a recorded walk.

    **Arguments:** `reading`: arrays (decisions, seeds, …), such as `Walk.reading` once the start is over; at least
    eight decisions; `period` between two of them in s.

    **Raises:** `ValueError` for another shape or a period that is not positive.
    """
    lateral = np.asarray(reading.lateral, float)
    right = lateral.ndim == 3 and len(lateral) >= 8
    check(right, "reading.lateral.shape", lateral.shape, "(decisions, seeds, 6) with at least 8 decisions")
    positive("period", period)
    first, second = (_centred(lateral[..., [LEGS.index(leg) for leg in tripod]].mean(-1)) for tripod in TRIPODS)
    spectra = [_spectrum(angle) for angle in (first, second)]
    frequencies = np.fft.rfftfreq(_PADDING * len(lateral), period)
    peak, seeds = np.abs(spectra[0]).argmax(0), np.arange(lateral.shape[1])
    one, other = (spectrum[peak, seeds] for spectrum in spectra)
    phase = np.abs(np.angle(one * other.conj())) / (2.0 * np.pi)
    power = np.sqrt((first**2).sum(0) * (second**2).sum(0))
    correlation = (first * second).sum(0) / np.where(power > 0.0, power, 1.0)
    speed = np.asarray(reading.speed, float).mean(0)
    path = np.asarray(reading.position, float)[[0, -1], :, :2]
    return Gait(
        kind=_kind(speed, phase, correlation),
        speed=speed,
        net=np.linalg.norm(path[1] - path[0], axis=-1) / (period * (len(lateral) - 1)),
        frequency=frequencies[peak],
        phase=phase,
        correlation=correlation,
        duty=debounced(np.asarray(reading.contact) > TOUCH, period).mean((0, 2)),
    )


def debounced(contact: np.ndarray, period: float) -> np.ndarray:
    """Contacts (decisions, …), true or false, without those and without gaps of less than 25 ms: the majority in a
    window of that length on either side. `period` between two decisions in s."""
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


def _centred(angle: Float[np.ndarray, "decisions seeds"]) -> Float[np.ndarray, "decisions seeds"]:
    return angle - angle.mean(0)


def _spectrum(angle: Float[np.ndarray, "decisions seeds"]) -> Any:
    window = np.hanning(len(angle))[:, None]
    return np.fft.rfft(window * angle, _PADDING * len(angle), axis=0)
