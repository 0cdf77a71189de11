"""What a composed task can observe."""

import jax.numpy as jnp

from motorgrad.schema import number, static
from motorgrad.tasks.terms._term import Bound, Names, Now, Observation, Scene, by_name


class JointPositions(Observation):
    """Positions of joints, in rad or m; of free and ball joints all numbers."""

    joints: Names = by_name("*", help="names or patterns of joints")

    def bind(self, scene: Scene) -> Bound:
        names, places = scene.positions(self.joints)
        return Bound(lambda now: now.state.position[places], tuple(names))


class JointVelocities(Observation):
    """Velocities of joints, in rad/s or m/s."""

    joints: Names = by_name("*", help="names or patterns of joints")

    def bind(self, scene: Scene) -> Bound:
        names, places = scene.velocities(self.joints)
        return Bound(lambda now: now.state.velocity[places], tuple(f"{name} velocity" for name in names))


class OfActuators(Observation):
    """A sensor reading of each actuator."""

    actuators: Names = by_name("*", help="names or patterns of actuators")

    def of(self, scene: Scene, kind: str, word: str) -> Bound:
        """The readings of sensors of a kind, named by a word."""
        names = scene.named("actuator", self.actuators)
        sensors = [scene.sensor(kind, "ACTUATOR", name) for name in names]
        return Bound(
            lambda now: jnp.stack([now.state.sensors[sensor] for sensor in sensors]),
            tuple(f"{name} {word}" for name in names),
        )


class MuscleLengths(OfActuators):
    """Lengths of muscles, in m; of any actuator the length of what it drives.

    **Arguments:**

    - `actuators`: names or patterns of actuators.
    """

    def bind(self, scene: Scene) -> Bound:
        return self.of(scene, "ACTUATORPOS", "length")


class MuscleVelocities(OfActuators):
    """Velocities at which muscles lengthen, in m/s.

    **Arguments:**

    - `actuators`: names or patterns of actuators.
    """

    def bind(self, scene: Scene) -> Bound:
        return self.of(scene, "ACTUATORVEL", "velocity")


class MuscleForces(OfActuators):
    """Forces of actuators, in N; negative for a muscle that pulls. They are those of the last physics step.

    **Arguments:**

    - `actuators`: names or patterns of actuators.
    """

    def bind(self, scene: Scene) -> Bound:
        return self.of(scene, "ACTUATORFRC", "force")


class Activations(Observation):
    """Activations of muscles and of other actuators that have an activation state."""

    actuators: Names = by_name("*", help="names or patterns of actuators")

    def bind(self, scene: Scene) -> Bound:
        names, places = scene.activations(self.actuators)
        return Bound(lambda now: now.state.activation[places], tuple(f"{name} activation" for name in names))


class Positions(Observation):
    """Positions in the world of sites, bodies or geoms, in m."""

    parts: Names = by_name((), help="names of sites, bodies or geoms")

    def bind(self, scene: Scene) -> Bound:
        return _vectors(scene, self.parts, False)


class Velocities(Observation):
    """Velocities in the world of sites, bodies or geoms, in m/s."""

    parts: Names = by_name((), help="names of sites, bodies or geoms")

    def bind(self, scene: Scene) -> Bound:
        return _vectors(scene, self.parts, True)


class TargetPosition(Observation):
    """The current position of a target."""

    target: str = static("target", help="name of the target")

    def bind(self, scene: Scene) -> Bound:
        target = scene.target(self.target)
        name = self.target
        return Bound(lambda now: target.at(now, name), tuple(f"{name} {n}" for n in target.names))


class TargetError(Observation):
    """The vector from the body to a target: for each number of the target, wanted − actual."""

    target: str = static("target", help="name of the target")

    def bind(self, scene: Scene) -> Bound:
        target = scene.target(self.target)
        name = self.target
        return Bound(lambda now: target.error(now, name), tuple(f"{name} error {n}" for n in target.names))


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
        return Bound(lambda now: jnp.concatenate([jnp.ravel(now.state.sensors[n]) for n in names]), tuple(labels))


class Contacts(Observation):
    """The force (N) with which sites are touched, or bodies are in contact with anything: normal forces within the
    volume of a site, the size of the whole force on a body.
    """

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
        )


class PreviousAction(Observation):
    """The controls of the last decision; 0 at the start of an episode."""

    actuators: Names = by_name("*", help="names or patterns of actuators")

    def bind(self, scene: Scene) -> Bound:
        places = scene.groups(self.actuators)
        return Bound(lambda now: now.control[places], tuple(f"{scene.body.groups[i]} before" for i in places))


class Clock(Observation):
    """The time since the start of the episode, in s; with a `period`, its sine and cosine."""

    period: float = number(0.0, 0, unit="s", help="period of the sine and cosine; 0 for the time itself")

    def bind(self, scene: Scene) -> Bound:
        if not self.period:
            return Bound(lambda now: now.time[None], ("time",))

        def read(now: Now) -> jnp.ndarray:
            angle = 2 * jnp.pi * now.cycles(self.period)
            return jnp.stack([jnp.sin(angle), jnp.cos(angle)])

        return Bound(read, ("sine of time", "cosine of time"))


def _vectors(scene: Scene, parts: Names, moving: bool) -> Bound:
    names = scene.parts(parts)
    read = [(scene.motion if moving else scene.point)(name) for name in names]
    word = " velocity" if moving else ""
    labels = tuple(f"{name}{word} {axis}" for name in names for axis in "xyz")
    return Bound(lambda now: jnp.concatenate([each(now.state) for each in read]), labels)
