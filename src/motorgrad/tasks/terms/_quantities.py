"""Numbers from which composed tasks make rewards, terminations and metrics."""

import abc
from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import Literal, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad._running import counted_on
from motorgrad.schema import count, number, static
from motorgrad.tasks.terms._term import (
    PURE,
    Bound,
    Names,
    Now,
    Numbers,
    Quantity,
    Scalar,
    Scene,
    by_name,
    common,
    norm,
    units_of,
    vector,
)

REST = 0.01
"""A load up to which a muscle rests."""


class OfTarget(Quantity):
    """A quantity that depends on a target."""

    target: str = static("target", help="name of the target")

    def distance(self, scene: Scene) -> Callable[[Now], Scalar]:
        """The distance from the body to the target, the length of the error, in m or rad."""
        target = scene.target(self.target)
        return lambda now: norm(target.error(now, self.target))


class OfPart(Quantity):
    """A quantity of a part of the body."""

    part: str = static("", help="name of a site, body or geom")


class OfDistance(OfTarget):
    """A function of the distance from the body to a target. Subclasses define `of`."""

    @abc.abstractmethod
    def of(self, distance: Scalar) -> Scalar:
        """The quantity at a distance, in m or rad."""

    def unit(self, distance: str) -> str:
        """The unit of the quantity, from that of the distance."""
        del distance
        return PURE

    def bind(self, scene: Scene) -> Bound:
        read = self.distance(scene)
        unit = self.unit(common(units_of(scene.target(self.target))))
        return Bound(lambda now: self.of(read(now)), units=unit)


class Distance(OfDistance):
    """How far the body is from a target: the length of the error, in m or rad, to a power."""

    power: float = number(1.0, 0, open_low=True, help="the exponent to which the length is raised")
    _: KW_ONLY
    weight: float = -1.0

    def of(self, distance: Scalar) -> Scalar:
        return distance if self.power == 1 else distance**self.power

    def unit(self, distance: str) -> str:
        if distance in ("", PURE):
            return distance
        power = {1.0: "", 2.0: "²", 3.0: "³"}.get(float(self.power))
        return "" if power is None else f"{distance}{power}"


class Closeness(OfDistance):
    r"""How close the body is to a target, $e^{-d^2/2w^2}$ of the distance $d$: 1 there, 0 far away."""

    width: float = number(0.1, 0, open_low=True, unit="m or rad", help="$w$, where it has fallen to 0.61")

    def of(self, distance: Scalar) -> Scalar:
        return jnp.exp(-0.5 * (distance / self.width) ** 2)


class Within(OfDistance):
    """Whether the body is within a tolerance of a target, 1 or 0: a bonus in the reward, the solved share as a
    reading."""

    tolerance: float = number(0.05, 0, open_low=True, unit="m or rad", help="distance below which it counts")

    def of(self, distance: Scalar) -> Scalar:
        return jnp.where(distance < self.tolerance, 1.0, 0.0)


class Beyond(OfTarget):
    """Whether the body is farther from a target than a limit, 1 or 0: a penalty in the reward."""

    limit: float = number(0.5, 0, open_low=True, unit="m or rad", help="distance above which it counts")
    after: float = number(0.0, 0, unit="s", help="time in an episode from which it counts")
    _: KW_ONLY
    weight: float = -1.0

    def bind(self, scene: Scene) -> Bound:
        # times are multiples of the period, but rounded
        read = self.distance(scene)
        half = scene.period / 2
        return Bound(
            lambda now: jnp.where((read(now) > self.limit) & (now.time > self.after - half), 1.0, 0.0), units=PURE
        )


class Success(OfTarget):
    """Whether the body was within a tolerance of a target at more than a number of decisions of the episode, 1 or 0. As
    a metric it is recorded at the end of each episode."""

    tolerance: float = number(0.05, 0, open_low=True, unit="m or rad", help="distance below which it counts")
    decisions: int = count(5, help="the number that must be exceeded")
    _: KW_ONLY
    at_end: bool = True

    def bind(self, scene: Scene) -> Bound:
        read = self.distance(scene)
        return Bound(
            lambda now: jnp.where(now.memory > self.decisions, 1.0, 0.0),
            init=lambda: jnp.zeros((), jnp.int32),
            step=lambda now: counted_on(now.memory, read(now) < self.tolerance),
            units=PURE,
        )


class Height(OfPart):
    """The height of a site, body or geom, in m."""

    def bind(self, scene: Scene) -> Bound:
        point = scene.point(self.part)
        return Bound(lambda now: point(now.state)[2], units="m")


class Upright(OfPart):
    """The cosine of the angle between an axis of a site, body or geom and the vertical: 1 upright, −1 upside down."""

    axis: Literal["x", "y", "z"] = static("z", help="axis of the part")

    def bind(self, scene: Scene) -> Bound:
        sensor = scene.sensor(f"FRAME{self.axis.upper()}AXIS", *scene.place(self.part))
        return Bound(lambda now: now.state.sensors[sensor][2], units=PURE)


class Along(OfPart):
    """The velocity of a site, body or geom along a direction of the world, in m/s."""

    direction: tuple[float, float, float] = vector((1.0, 0.0, 0.0), help="in the world; its length does not matter")
    most: float | None = number(None, 0, unit="m/s", help="a higher velocity counts as this one")

    def validate(self) -> None:
        check(any(self.direction), "direction", self.direction, "three numbers that are not all 0")

    def bind(self, scene: Scene) -> Bound:
        motion = scene.motion(self.part)
        ahead = np.asarray(self.direction, float) / np.linalg.norm(self.direction)

        def read(now: Now) -> Array:
            speed = jnp.sum(motion(now.state) * ahead)
            return speed if self.most is None else jnp.minimum(speed, self.most)

        return Bound(read, units="m/s")


class Speed(Quantity):
    """The speed of a site, body or geom in m/s; without one, the root of the mean square velocity of the joints."""

    part: str | None = static(None, help="name of a site, body or geom, or none")
    joints: Names = by_name("*", help="names or patterns of joints")
    _: KW_ONLY
    weight: float = -1.0

    def bind(self, scene: Scene) -> Bound:
        if self.part is not None:
            motion = scene.motion(self.part)
            return Bound(lambda now: norm(motion(now.state)), units="m/s")
        places = scene.velocities(self.joints)[1]
        unit = common(scene.velocity_units(places))
        return Bound(lambda now: norm(now.state.velocity[places]) / len(places) ** 0.5, units=unit)


class Outside(OfPart):
    """Whether a site, body or geom is outside a box, 1 or 0. As a termination, it needs no limit."""

    low: Numbers = vector((-1.0, -1.0, -1.0), unit="m", help="the lowest corner of the box")
    high: Numbers = vector((1.0, 1.0, 1.0), unit="m", help="the highest corner of the box")
    _: KW_ONLY
    weight: float = -1.0
    above: float | None = 0.5

    def validate(self) -> None:
        fine = len(self.low) == len(self.high) == 3 and all(a < b for a, b in zip(self.low, self.high, strict=True))
        check(fine, "low, high", (self.low, self.high), "three numbers each, low < high")

    def bind(self, scene: Scene) -> Bound:
        point = scene.point(self.part)
        low = np.array(self.low)
        high = np.array(self.high)
        return Bound(lambda now: jnp.any((point(now.state) < low) | (point(now.state) > high)) * 1.0, units=PURE)


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
    weight: float = -1.0

    def bind(self, scene: Scene) -> Bound:
        levels, count = self._levels(scene)
        unit = PURE if self.of == "control" else scene.level_unit(self.actuators)
        if self.root:
            return Bound(lambda now: norm(levels(now)) / count, units=unit)
        return Bound(lambda now: jnp.mean(levels(now) ** self.power), units=unit)

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
    weight: float = -1.0

    def bind(self, scene: Scene) -> Bound:
        load, count = _control_shares(scene, self.actuators)
        nothing = jnp.zeros(count)
        return Bound(
            lambda now: jnp.mean(now.memory.fatigued),
            init=lambda: Compartments(nothing, nothing),
            step=lambda now: self.after(now.memory, load(now), scene.period),
            units=PURE,
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
    """1 at every decision."""

    def bind(self, scene: Scene) -> Bound:
        del scene
        return Bound(lambda now: jnp.ones(()), units=PURE)


def _control_shares(scene: Scene, actuators: Names) -> tuple[Callable[[Now], Array], int]:
    """The size of each of these actuators' controls as a share of its greatest, and how many there are."""
    places = scene.groups(actuators)
    most = np.maximum(np.abs(scene.control_range).max(axis=1), 1e-9)[places]
    return lambda now: jnp.abs(now.control[places]) / most, len(places)
