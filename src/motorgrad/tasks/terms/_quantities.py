"""Numbers from which composed tasks make rewards, terminations and metrics."""

import abc
from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import Literal, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad._running import counted_on
from motorgrad.schema import count, inner, number, static
from motorgrad.tasks.terms._term import Bound, Names, Now, Numbers, Quantity, Scalar, Scene, by_name, norm, vector

REST = 0.01
"""A load up to which a muscle rests."""


class OfDistance(Quantity):
    """A function of the distance from the body to a target, the length of the error. Subclasses define `of`."""

    target: eqx.AbstractVar[str]

    @abc.abstractmethod
    def of(self, distance: Scalar) -> Scalar:
        """The quantity at a distance, in m or rad."""

    def bind(self, scene: Scene) -> Bound:
        read = _distance(scene, self.target)
        return Bound(lambda now: self.of(read(now)))


class Distance(OfDistance):
    """How far the body is from a target: the length of the error, in m or rad, to a power."""

    target: str = static("target", help="name of the target")
    power: float = number(1.0, 0, open_low=True, help="the exponent to which the length is raised")
    _: KW_ONLY
    weight: float = number(-1.0, help="factor in the reward, by default −1")

    def of(self, distance: Scalar) -> Scalar:
        return distance if self.power == 1 else distance**self.power


class Closeness(OfDistance):
    r"""How close the body is to a target, $e^{-d^2/2w^2}$ of the distance $d$: 1 there, 0 far away.

    **Arguments:**

    - `weight`: factor in the reward, by default 1.
    """

    target: str = static("target", help="name of the target")
    width: float = number(0.1, 0, open_low=True, unit="m or rad", help="$w$, where it has fallen to 0.61")

    def of(self, distance: Scalar) -> Scalar:
        return jnp.exp(-0.5 * (distance / self.width) ** 2)


class Within(OfDistance):
    """Whether the body is within a tolerance of a target, 1 or 0: a bonus in the reward, the solved share as a reading.

    **Arguments:**

    - `weight`: factor in the reward, by default 1.
    """

    target: str = static("target", help="name of the target")
    tolerance: float = number(0.05, 0, open_low=True, unit="m or rad", help="distance below which it counts")

    def of(self, distance: Scalar) -> Scalar:
        return jnp.where(distance < self.tolerance, 1.0, 0.0)


class Beyond(Quantity):
    """Whether the body is farther from a target than a limit, 1 or 0: a penalty in the reward."""

    target: str = static("target", help="name of the target")
    limit: float = number(0.5, 0, open_low=True, unit="m or rad", help="distance above which it counts")
    after: float = number(0.0, 0, unit="s", help="time in an episode from which it counts")
    _: KW_ONLY
    weight: float = number(-1.0, help="factor in the reward, by default −1")

    def bind(self, scene: Scene) -> Bound:
        # times are multiples of the period, but rounded
        read = _distance(scene, self.target)
        half = scene.period / 2
        return Bound(lambda now: jnp.where((read(now) > self.limit) & (now.time > self.after - half), 1.0, 0.0))


class Success(Quantity):
    """Whether the body was within a tolerance of a target at more than a number of decisions of the episode, 1 or 0. As
    a metric it is recorded at the end of each episode.

    **Arguments:**

    - `weight`: factor in the reward, by default 1.
    """

    target: str = static("target", help="name of the target")
    tolerance: float = number(0.05, 0, open_low=True, unit="m or rad", help="distance below which it counts")
    decisions: int = count(5, help="the number that must be exceeded")
    _: KW_ONLY
    at_end: bool = static(True)

    def bind(self, scene: Scene) -> Bound:
        read = _distance(scene, self.target)
        return Bound(
            lambda now: jnp.where(now.memory > self.decisions, 1.0, 0.0),
            init=lambda: jnp.zeros((), jnp.int32),
            step=lambda now: counted_on(now.memory, read(now) < self.tolerance),
        )


class Height(Quantity):
    """The height of a site, body or geom, in m.

    **Arguments:**

    - `weight`: factor in the reward, by default 1.
    """

    part: str = static("", help="name of a site, body or geom")

    def bind(self, scene: Scene) -> Bound:
        point = scene.point(self.part)
        return Bound(lambda now: point(now.state)[2])


class Upright(Quantity):
    """The cosine of the angle between an axis of a site, body or geom and the vertical: 1 upright, −1 upside down.

    **Arguments:**

    - `weight`: factor in the reward, by default 1.
    """

    part: str = static("", help="name of a site, body or geom")
    axis: Literal["x", "y", "z"] = static("z", help='axis of the part, `"x"`, `"y"` or `"z"`')

    def bind(self, scene: Scene) -> Bound:
        sensor = scene.sensor(f"FRAME{self.axis.upper()}AXIS", *scene.place(self.part))
        return Bound(lambda now: now.state.sensors[sensor][2])


class Along(Quantity):
    """The velocity of a site, body or geom along a direction of the world, in m/s.

    **Arguments:**

    - `weight`: factor in the reward, by default 1.
    """

    part: str = static("", help="name of a site, body or geom")
    direction: tuple[float, float, float] = vector((1.0, 0.0, 0.0), help="in the world; its length does not matter"
    )
    most: float | None = number(None, 0, unit="m/s", help="a higher velocity counts as this one")

    def validate(self) -> None:
        check(any(self.direction), "direction", self.direction, "three numbers that are not all 0")

    def bind(self, scene: Scene) -> Bound:
        motion = scene.motion(self.part)
        ahead = np.asarray(self.direction, float) / np.linalg.norm(self.direction)

        def read(now: Now) -> Array:
            speed = jnp.sum(motion(now.state) * ahead)
            return speed if self.most is None else jnp.minimum(speed, self.most)

        return Bound(read)


class Speed(Quantity):
    """The speed of a site, body or geom in m/s; without one, the root of the mean square velocity of the joints."""

    part: str | None = static(None, help="name of a site, body or geom, or none")
    joints: Names = by_name("*", help="names or patterns of joints")
    _: KW_ONLY
    weight: float = number(-1.0, help="factor in the reward, by default −1")

    def bind(self, scene: Scene) -> Bound:
        if self.part is not None:
            motion = scene.motion(self.part)
            return Bound(lambda now: norm(motion(now.state)))
        places = scene.velocities(self.joints)[1]
        return Bound(lambda now: norm(now.state.velocity[places]) / len(places) ** 0.5)


class Outside(Quantity):
    """Whether a site, body or geom is outside a box, 1 or 0. As a termination, it needs no limit."""

    part: str = static("", help="name of a site, body or geom")
    low: Numbers = vector((-1.0, -1.0, -1.0), unit="m", help="the lowest corner of the box")
    high: Numbers = vector((1.0, 1.0, 1.0), unit="m", help="the highest corner of the box")
    _: KW_ONLY
    weight: float = number(-1.0, help="factor in the reward, by default −1")
    above: float | None = number(0.5)

    def validate(self) -> None:
        fine = len(self.low) == len(self.high) == 3 and all(a < b for a, b in zip(self.low, self.high, strict=True))
        check(fine, "low, high", (self.low, self.high), "three numbers each, low < high")

    def bind(self, scene: Scene) -> Bound:
        point = scene.point(self.part)
        low = np.array(self.low)
        high = np.array(self.high)
        return Bound(lambda now: jnp.any((point(now.state) < low) | (point(now.state) > high)) * 1.0)


class Effort(Quantity):
    """The mean over actuators of the activation, or of the control as a share of its greatest, to a power."""

    of: Literal["activation", "control"] = static(
        "control", help='`"control"`, which every actuator has, or `"activation"`'
    )
    actuators: Names = by_name("*", help="names or patterns of actuators")
    power: float = number(2.0, 0, open_low=True, help="2 for the mean square")
    root: bool = static(
        False, help="whether to take the length of the vector instead, divided by the number of actuators"
    )
    _: KW_ONLY
    weight: float = number(-1.0, help="factor in the reward, by default −1")

    def bind(self, scene: Scene) -> Bound:
        levels, count = self._levels(scene)
        if self.root:
            return Bound(lambda now: norm(levels(now)) / count)
        return Bound(lambda now: jnp.mean(levels(now) ** self.power))

    def _levels(self, scene: Scene) -> tuple[Callable[[Now], Array], int]:
        """The levels of the actuators, and how many there are."""
        if self.of == "control":
            return _control_shares(scene, self.actuators)
        places = scene.activations(self.actuators)[1]
        return lambda now: jnp.abs(now.state.activation[places]), len(places)


class Compartments(NamedTuple):
    """The shares of each muscle's motor units that are `active` and `fatigued`; the others rest."""

    active: Float[Array, " muscles"]
    fatigued: Float[Array, " muscles"]


class Fatigue(Quantity):
    r"""The mean share of fatigued motor units, by the three-compartment model. It does not weaken the muscles.

    Of the motor units of each muscle, the share $M_A$ is active, $M_F$ fatigued, and $M_R = 1 - M_A - M_F$ resting. The
    target load $T$ is the muscle's control as a share of its greatest:

    $$\dot M_A = C - F M_A, \qquad \dot M_F = F M_A - R' M_F,$$

    where $C = L_D \min(T - M_A, M_R)$ below the load and $C = L_R (T - M_A)$ above it. At rest, that is for
    $T \le 0.01$, $R' = r R$, otherwise $R' = R$.

    Sources: the model, with $L_D = L_R = 10$, from Xia & Frey Law (2008), J. Biomech. 41:3046; $F$ and $R$ of the elbow
    from Frey-Law, Looft & Heitsman (2012), J. Biomech. 45:1803, Table 1; $r$ from Looft, Herkert & Frey-Law (2018),
    J. Biomech. 77:16. A control of nearly 0 counts as rest, as in MyoSuite, because graded units never reach 0.
    """

    actuators: Names = by_name("*", help="names or patterns of the muscles")
    fatigue: float = number(0.00912, 0, unit="1/s", help="$F$, the rate at which active units tire")
    recovery: float = number(0.00094, 0, unit="1/s", help="$R$, the rate at which fatigued units recover")
    rest: float = number(15.0, 1, help="$r$, how much faster they recover at rest")
    rise: float = number(
        10.0, 0, open_low=True, unit="1/s", help="$L_D = L_R$, the rate at which active units follow the load"
    )
    speedup: float = number(
        1.0,
        0,
        open_low=True,
        help="the factor by which both fatigue and recovery are faster than in life, for short episodes",
    )
    _: KW_ONLY
    weight: float = number(-1.0, help="factor in the reward, by default −1")

    def bind(self, scene: Scene) -> Bound:
        load, count = _control_shares(scene, self.actuators)
        nothing = jnp.zeros(count)
        return Bound(
            lambda now: jnp.mean(now.memory.fatigued),
            init=lambda: Compartments(nothing, nothing),
            step=lambda now: self.after(now.memory, load(now), scene.period),
        )

    def after(self, state: Compartments, load: Array, seconds: float) -> Compartments:
        """The compartments after some seconds under a load."""
        fast = max(self.rise, self.speedup * max(self.fatigue, self.rest * self.recovery))
        parts = max(1, int(np.ceil(10 * seconds * fast)))  # Euler's method, ten steps in the shortest time constant
        step = seconds / parts
        recovery = self.speedup * self.recovery * jnp.where(load <= REST, self.rest, 1.0)
        for _ in range(parts):
            active, fatigued = state
            drive = self.rise * jnp.minimum(load - active, 1 - active - fatigued)
            tires = self.speedup * self.fatigue * active
            recovers = recovery * fatigued
            state = Compartments(active + step * (drive - tires), fatigued + step * (tires - recovers))
        return state


class Alive(Quantity):
    """1 at every decision.

    **Arguments:**

    - `weight`: factor in the reward, by default 1.
    """

    def bind(self, scene: Scene) -> Bound:
        del scene
        return Bound(lambda now: jnp.ones(()))


def _control_shares(scene: Scene, actuators: Names) -> tuple[Callable[[Now], Array], int]:
    """The size of each of these actuators' controls as a share of its greatest, and how many there are."""
    places = scene.groups(actuators)
    most = np.maximum(np.abs(scene.control_range).max(axis=1), 1e-9)[places]
    return lambda now: jnp.abs(now.control[places]) / most, len(places)


def _distance(scene: Scene, name: str) -> Callable[[Now], Scalar]:
    target = scene.target(name)
    return lambda now: norm(target.error(now, name))
