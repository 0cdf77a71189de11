"""What a composed task can observe."""

from typing import ClassVar

import jax.numpy as jnp

from motorgrad.bodies import sensor_columns
from motorgrad.schema import number, static
from motorgrad.tasks.terms._term import PURE, Bound, Names, Now, Observation, Scene, by_name


class OfJoints(Observation):
    """Numbers of joints."""

    joints: Names = by_name("*", help="names or patterns of joints")


class JointPositions(OfJoints):
    """Positions of joints, in rad or m; of free and ball joints all numbers."""

    def bind(self, scene: Scene) -> Bound:
        names, places = scene.positions(self.joints)
        return Bound(lambda now: now.state.position[places], tuple(names), units=scene.position_units(places))


class JointVelocities(OfJoints):
    """Velocities of joints, in rad/s or m/s."""

    def bind(self, scene: Scene) -> Bound:
        names, places = scene.velocities(self.joints)
        labels = tuple(f"{name} velocity" for name in names)
        return Bound(lambda now: now.state.velocity[places], labels, units=scene.velocity_units(places))


class OfActuators(Observation):
    """Numbers of actuators."""

    actuators: Names = by_name("*", help="names or patterns of actuators")


class OfSensors(OfActuators):
    """A sensor reading of each actuator. Subclasses say of which kind, what it reads, and the place of its unit."""

    kind: ClassVar[str]
    reads: ClassVar[str]
    place: ClassVar[int]

    def bind(self, scene: Scene) -> Bound:
        names = scene.named("actuator", self.actuators)
        sensors = [scene.sensor(self.kind, "ACTUATOR", name) for name in names]
        return Bound(
            lambda now: jnp.stack([now.state.sensors[sensor] for sensor in sensors]),
            tuple(f"{name} {self.reads}" for name in names),
            units=tuple(scene.actuator_units(name)[self.place] for name in names),
        )


class MuscleLengths(OfSensors):
    """Lengths of muscles, in m; of any actuator the length of what it drives."""

    kind = "ACTUATORPOS"
    reads = "length"
    place = 0


class MuscleVelocities(OfSensors):
    """Velocities at which muscles lengthen, in m/s."""

    kind = "ACTUATORVEL"
    reads = "velocity"
    place = 1


class MuscleForces(OfSensors):
    """Forces of actuators, in N; negative for a muscle that pulls. They are those of the last physics step."""

    kind = "ACTUATORFRC"
    reads = "force"
    place = 2


class Activations(OfActuators):
    """Activations of muscles and of other actuators that have an activation state."""

    def bind(self, scene: Scene) -> Bound:
        names, places = scene.activations(self.actuators)
        labels = tuple(f"{name} activation" for name in names)
        units = tuple(map(scene.level_unit, names))
        return Bound(lambda now: now.state.activation[places], labels, units=units)


class OfParts(Observation):
    """Vectors in the world of parts of the body."""

    parts: Names = by_name((), help="names of sites, bodies or geoms")


class Positions(OfParts):
    """Positions in the world of sites, bodies or geoms, in m."""

    def bind(self, scene: Scene) -> Bound:
        return _vectors(scene, self.parts, False)


class Velocities(OfParts):
    """Velocities in the world of sites, bodies or geoms, in m/s."""

    def bind(self, scene: Scene) -> Bound:
        return _vectors(scene, self.parts, True)


class OfTarget(Observation):
    """Numbers of a target."""

    target: str = static("target", help="name of the target")


class TargetPosition(OfTarget):
    """The current position of a target."""

    def bind(self, scene: Scene) -> Bound:
        target = scene.target(self.target)
        name = self.target
        return Bound(lambda now: target.at(now, name), tuple(f"{name} {n}" for n in target.names), units=target.units)


class TargetError(OfTarget):
    """The vector from the body to a target: for each number of the target, wanted − actual."""

    def bind(self, scene: Scene) -> Bound:
        target = scene.target(self.target)
        name = self.target
        labels = tuple(f"{name} error {n}" for n in target.names)
        return Bound(lambda now: target.error(now, name), labels, units=target.units)


class SensorReadings(Observation):
    """Readings of the model's own sensors."""

    sensors: Names = by_name("*", help="names or patterns of sensors")

    def bind(self, scene: Scene) -> Bound:
        names = scene.named("sensor", self.sensors)
        sizes = [int(scene.model.sensor(name).dim[0]) for name in names]
        single = scene.body.sensor_components
        labels = [
            name if size == 1 or name in single else f"{name} {k + 1}"
            for name, size in zip(names, sizes, strict=True)
            for k in range(1 if name in single else size)
        ]
        units = tuple(
            unit
            for name in names
            for _, _, unit in sensor_columns(scene.model, scene.model.sensor(name).id)[: 1 if name in single else None]
        )
        read = lambda now: jnp.concatenate([jnp.ravel(now.state.sensors[n]) for n in names])  # noqa: E731
        return Bound(read, tuple(labels), units=units)


class Contacts(Observation):
    """The force (N) with which sites are touched, or bodies are in contact with anything: normal forces within the
    volume of a site, the size of the whole force on a body."""

    parts: Names = by_name((), help="names of sites or bodies")

    def bind(self, scene: Scene) -> Bound:
        wanted = scene.parts(self.parts)
        sensors = []
        for name in wanted:
            kind, _ = scene.place(name)
            if kind == "SITE":
                sensors.append(scene.sensor("TOUCH", "SITE", name))
            else:  # data: force; reduce: net force; one contact
                sensors.append(scene.sensor("CONTACT", "GEOM" if kind == "GEOM" else "BODY", name, 2, 3, 1))
        return Bound(
            lambda now: jnp.stack([jnp.sqrt(jnp.sum(jnp.square(now.state.sensors[each]))) for each in sensors]),
            tuple(f"{name} contact" for name in wanted),
            units="N",
        )


class PreviousAction(OfActuators):
    """The controls of the last decision; 0 at the start of an episode."""

    def bind(self, scene: Scene) -> Bound:
        places = scene.groups(self.actuators)
        labels = tuple(f"{scene.body.groups[i]} before" for i in places)
        return Bound(lambda now: now.control[places], labels, units=scene.level_unit(self.actuators))


class Clock(Observation):
    """The time since the start of the episode, in s; with a `period`, its sine and cosine."""

    period: float = number(0.0, 0, unit="s", help="period of the sine and cosine; 0 for the time itself")

    def bind(self, scene: Scene) -> Bound:
        if not self.period:
            return Bound(lambda now: now.time[None], ("time",), units="s")

        def read(now: Now) -> jnp.ndarray:
            angle = 2 * jnp.pi * now.cycles(self.period)
            return jnp.stack([jnp.sin(angle), jnp.cos(angle)])

        return Bound(read, ("sine of time", "cosine of time"), units=PURE)


def _vectors(scene: Scene, parts: Names, moving: bool) -> Bound:
    names = scene.parts(parts)
    read = [(scene.motion if moving else scene.point)(name) for name in names]
    word = " velocity" if moving else ""
    labels = tuple(f"{name}{word} {axis}" for name in names for axis in "xyz")
    unit = "m/s" if moving else "m"
    return Bound(lambda now: jnp.concatenate([each(now.state) for each in read]), labels, units=unit)
