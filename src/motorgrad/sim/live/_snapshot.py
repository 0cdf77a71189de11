"""What a page sees of a run: its present moment, the moments just before, and the learning curve so far."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

MOST_BODIES = 2
"""Side by side: the body that learns, and an untrained one."""


class Snapshot(NamedTuple):
    """One moment of the bodies in view, copied out of shared memory; all of it belongs to the same decision.

    - `decision`: decisions made; `seconds`: simulated time, in s.
    - `playing`; `frozen`, whether nothing is learnt; `speed`: simulated seconds per second of wall time, as achieved.
    - `position`, `velocity`, `activation`, `control`: MuJoCo's `qpos`, `qvel`, `act` and `ctrl` of each body. In a
      JAX world the first two are the state's, or the first all of it.
    - `observation`; `probability`: each unit's probability of firing on it, or its mean activation.
    - `reward` of the last decision; `baseline`; `gradient_norm`: of the last gradient, NaN where it is not known.
    - `parameters`: the trainable ones of the policy that acts, flat.
    - `reset_count`: how often the run began anew or was put elsewhere; `oldest`, `newest`: the decisions between which
      it can be put back.

    The first axis is of bodies: the one that learns, then an untrained one while both stand side by side. NaN is what
    the subject does not have.
    """

    decision: int
    seconds: float
    playing: bool
    frozen: bool
    speed: float
    position: Float[np.ndarray, "bodies nq"]
    velocity: Float[np.ndarray, "bodies nv"]
    activation: Float[np.ndarray, "bodies na"]
    control: Float[np.ndarray, "bodies nu"]
    observation: Float[np.ndarray, "bodies observations"]
    probability: Float[np.ndarray, "bodies actions"]
    reward: Float[np.ndarray, " bodies"]
    baseline: Float[np.ndarray, " bodies"]
    gradient_norm: Float[np.ndarray, " bodies"]
    parameters: Float[np.ndarray, "bodies parameters"]
    reset_count: int
    oldest: int
    newest: int


class Trail(NamedTuple):
    """The last decisions of the body that learns, oldest first: some 20 s of simulated time at most.

    Where the run is much faster than can be watched, stretches of consecutive decisions are kept and those between
    them are left out; `decision` says which there are.

    - `activation`: of each actuator; `action`: what the policy chose; both are under way from this decision on.
    - `contacts`: of each foot (`Session.feet`), the force of its touch sensor, in N.
    """

    decision: Int[np.ndarray, " n"]
    seconds: Float[np.ndarray, " n"]
    position: Float[np.ndarray, "n nq"]
    velocity: Float[np.ndarray, "n nv"]
    activation: Float[np.ndarray, "n nu"]
    action: Float[np.ndarray, "n actions"]
    reward: Float[np.ndarray, " n"]
    contacts: Float[np.ndarray, "n feet"]
    observation: Float[np.ndarray, "n observations"]
    probability: Float[np.ndarray, "n actions"]


class Curve(NamedTuple):
    """The learning curve since the start, thinned to at most 2,000 points: means over the decisions before each point.

    - `values`: by name, `reward`, then the task's readings (`apex`, `speed`, …), NaN where one did not occur.
    - `frozen`: whether nothing was learnt then.
    """

    decision: Int[np.ndarray, " points"]
    seconds: Float[np.ndarray, " points"]
    reward: Float[np.ndarray, " points"]
    values: dict[str, Float[np.ndarray, " points"]]
    frozen: Bool[np.ndarray, " points"]


class Sizes(NamedTuple):
    """How large everything is, which the worker finds out and tells the page."""

    position: int
    velocity: int
    activation: int
    control: int
    observation: int
    action: int
    parameters: int
    feet: int
    trail: int
    readings: int


POINTS = 2_000
NUMBERS = ("decision", "seconds", "playing", "frozen", "speed", "reset_count", "oldest", "newest", "bodies")
COUNTS = ("decision", "reset_count", "oldest", "newest")
ARRAYS = ("position", "velocity", "activation", "control", "observation", "probability", "parameters")
SCALARS = ("reward", "baseline", "gradient_norm")


def layout(sizes: Sizes) -> dict[str, dict[str, tuple[int, ...]]]:
    """The arrays in shared memory, by part: their shapes; all are of double precision."""
    named = sizes._asdict() | {"probability": sizes.action, "contacts": sizes.feet}
    moment = dict.fromkeys(NUMBERS, ())
    moment |= {name: (MOST_BODIES, named[name]) for name in ARRAYS}
    moment |= dict.fromkeys(SCALARS, (MOST_BODIES,))
    n = sizes.trail
    trail: dict[str, tuple[int, ...]] = dict.fromkeys(("decision", "seconds", "reward"), (n,))
    trail |= {"activation": (n, sizes.control)}
    trail |= {name: (n, named[name]) for name in ("position", "velocity", "action", "contacts")}
    trail |= {name: (n, named[name]) for name in ("observation", "probability")}
    points: dict[str, tuple[int, ...]] = dict.fromkeys(("decision", "seconds", "frozen"), (POINTS,))
    curve = points | {"count": (), "values": (1 + sizes.readings, POINTS)}
    return {"moment": moment, "trail": trail | {"count": (), "next": ()}, "curve": curve}
