"""Bodies under the fixed controller, many of them."""

import dataclasses

import numpy as np

from motorgrad.bodies import Hexapod

JITTER = 1e-3
"""Of the servos' gain, relative: too little to matter, and enough for walks, which are chaotic, to part."""


def alike(count: int) -> list[Hexapod]:
    """Hexapods with servos that are the same but for tiny differences of their servos' gain: walks of the first are
    one sample, of all the spread that chaos has."""
    gains = 1.0 + JITTER * np.random.default_rng(0).uniform(-1.0, 1.0, count)
    body = Hexapod(drive="servos")
    return [dataclasses.replace(body, servo_gain=body.servo_gain * float(gain)) for gain in gains]
