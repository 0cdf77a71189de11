"""Figure A.2: the circular force field."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, ClassVar

import numpy as np

from motorgrad.plane import draw_paths, draw_regions
from motorgrad.schema import number
from motorgrad.statistics import exact
from motorgrad.worlds import CircularField, ParticlePhysics, Walls
from motorgrad_thesis._claims import Claim, at_least, at_most, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, subplots

FREE = Walls(left=-50.0, right=50.0, bottom=-50.0, top=50.0)
PLACES = 400  # random places at which the force is checked
STARTS = ((0.55, 0.5), (0.5, 0.98), (0.1, 0.2), (0.9, 0.9))
CLOSE = 1e-3  # tolerance: single precision over thousands of steps


@experiment("fig-a.2", "the circular field of force", "figure A.2")
class Circular(Experiment):
    """A force field that drives a particle clockwise round a centre and, like a spring, towards a radius r*; paths in
    this field, and the orbit on which they end. With drag the orbit is wider than r*: its radius is k₂ r*/(k₂ − k₁²)
    for a mass and a drag of 1, and it exists only if k₂ exceeds k₁².
    """

    reading: ClassVar[str] = (
        "The printed force turns anticlockwise and leaves the centre out of its second part; here it turns "
        "clockwise, as the text says, about the centre."
    )

    tangential: float = number(
        0.5,
        -1e6,
        1e6,
        open_low=True,
        open_high=True,
        unit="1/s²",
        help="strength k₁ of the turning force in the drawing",
    )
    radial: float = number(
        1.0, 0, 1e6, open_low=True, open_high=True, unit="1/s²", help="strength k₂ of the spring in the drawing"
    )
    radius: float = number(0.25, 0, 1e6, open_low=True, open_high=True, help="radius r* in the drawing")
    seconds: float = number(
        200.0, 1, 10**5, unit="simulated s", help="duration of a motion before its orbit is measured"
    )

    def validate(self) -> None:
        super().validate()
        self.physics(self.tangential, self.radial)

    quick = smoke(seconds=40.0)

    def physics(self, tangential: float, radial: float, mass: float = 1.0, drag: float = 1.0) -> ParticlePhysics:
        """A particle in such a field, without gravity and far from all walls."""
        field = CircularField(tangential, radial, self.radius)
        return ParticlePhysics(mass=mass, gravity=(0.0, 0.0), drag=drag, walls=FREE, field=field)

    def run(self, work: Workspace) -> Values:
        physics = self.physics(self.tangential, self.radial)
        # tangential, radial, mass, drag: several tangential parts, then other masses and drags
        share = np.array([0.0, 0.3, 0.6, 0.8, 0.9])
        cases = [(s * np.sqrt(self.radial), self.radial, 1.0, 1.0) for s in share]
        cases += [(self.tangential, self.radial, 0.5, 1.0), (self.tangential, self.radial, 1.0, 1.5)]
        measured = [orbit(self.physics(*case), (0.5 + self.radius, 0.5), self.seconds) for case in cases]
        places = np.random.default_rng(0).random((PLACES, 2))
        return {
            "share": share,
            "cases": np.array(cases),
            "expected": np.array([self.physics(*case).orbit_radius for case in cases]),
            "measured": np.array([radius for radius, _ in measured]),
            "turning": np.array([turning for _, turning in measured]),
            "places": places,
            "force": force_at(physics.field, places),
            "paths": np.stack([path(physics, start, 20.0) for start in STARTS]),
        }

    def figure(self, values: Values) -> Figure:
        figure, axes = subplots(11, 3.9, 1, 3, width_ratios=[1, 1, 1.15])
        physics = self.physics(self.tangential, self.radial)
        draw_field(axes[0], physics, force_at, ())
        draw_field(axes[1], physics, None, list(values["paths"]))
        draw_limits(axes[2], values, self.radius)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        away = values["places"] - 0.5
        distance = np.linalg.norm(away, axis=1)
        outwards = away / distance[:, None]
        clockwise = np.stack([outwards[:, 1], -outwards[:, 0]], axis=1)
        wanted = self.tangential * distance[:, None] * clockwise
        wanted = wanted + self.radial * (self.radius - distance)[:, None] * outwards
        off = float(np.abs(values["force"] - wanted).max())
        radius = np.abs(values["measured"] / values["expected"] - 1)
        mass, drag = values["cases"][:, 2:].T
        turning = np.abs(values["turning"] + values["cases"][:, 0] / drag)
        yield at_most(
            1e-6,
            "The force is k₁ r clockwise and k₂ (r* − r) outwards.",
            exact(off),
            "greatest difference",
            note=f"The greatest difference at {len(away)} places. As printed, the first part turns anticlockwise.",
            source="appendix A.3",
        )
        yield at_most(
            CLOSE,
            "Without actions the orbit has the radius k₂ r*/(k₂ − m k₁²/k_d²).",
            exact(float(radius.max())),
            "deviation of the ratio of measured to expected radius from 1",
            note=f"The greatest deviation over {len(radius)} fields and particles, masses {mass.min():g} and "
            f"{mass.max():g}, drags {drag.min():g} and {drag.max():g}.",
            kind="extension",
            source="appendix A.3, solved for a steady circle",
        )
        yield at_most(
            CLOSE,
            "The particle goes round the orbit clockwise at k₁/k_d rad/s.",
            exact(float(turning.max())),
            "greatest difference",
            "rad/s",
            kind="extension",
            source="appendix A.3, solved for a steady circle",
        )
        yield within(
            1 - CLOSE,
            1 + CLOSE,
            "Without the tangential part the particle comes to rest at r*.",
            exact(float(values["measured"][0] / self.radius)),
            "radius / r*",
            source="appendix A.3",
        )
        yield at_least(
            1,
            "There is no orbit unless k₂ exceeds k₁².",
            exact(float(refused(lambda: self.physics(np.sqrt(self.radial), self.radial)))),
            "whether a field with k₂ = k₁² is refused (1 if it is)",
            kind="extension",
            source="appendix A.3, solved for a steady circle",
        )


def refused(make: Any) -> bool:
    """Whether `make` raises `ValueError`."""
    try:
        make()
    except ValueError:
        return True
    return False


def force_at(field: CircularField, places: np.ndarray) -> np.ndarray:
    """The force at each place, `(places, 2)`."""
    import jax
    import jax.numpy as jnp

    return np.asarray(jax.vmap(lambda place: jnp.stack(field.force(*place)))(jnp.asarray(places, jnp.float32)))


def path(physics: ParticlePhysics, start: tuple[float, float], seconds: float) -> np.ndarray:
    """Positions at every time step of a particle that starts at rest, `(steps + 1, 2)`."""
    import jax
    import jax.numpy as jnp

    zero = jnp.zeros(())
    begin = ((jnp.asarray(start[0]), jnp.asarray(start[1])), (zero, zero))

    def move(motion: Any, _: None) -> Any:
        after = physics.step(motion, (zero, zero))[0]
        return after, jnp.stack(after[0])

    moved = jax.lax.scan(move, begin, length=round(seconds / physics.timestep))[1]
    return np.concatenate([[start], np.asarray(moved)])


def orbit(physics: ParticlePhysics, start: tuple[float, float], seconds: float) -> tuple[float, float]:
    """Radius and angular velocity (rad/s, anticlockwise) of a path from rest: means over its last tenth."""
    away = path(physics, start, seconds) - 0.5
    last = away[-max(2, len(away) // 10) :]
    angle = np.unwrap(np.arctan2(last[:, 1], last[:, 0]))
    turning = (angle[-1] - angle[0]) / (physics.timestep * (len(angle) - 1))
    return float(np.linalg.norm(last, axis=1).mean()), float(turning)


def draw_field(
    axes: Axes, physics: ParticlePhysics, force: Callable[..., np.ndarray] | None, paths: Sequence[np.ndarray]
) -> None:
    """The unit square with arrows of the force, paths, the radius r* and the orbit."""
    draw_regions(axes, ())
    if force is not None:
        side = np.linspace(0.04, 0.96, 15)
        places = np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)
        arrows = force(physics.field, places)
        strength = np.linalg.norm(arrows, axis=1)
        drawn: Any = axes.quiver(*places.T, *arrows.T, strength, cmap="viridis_r", width=0.006, scale=7)
        axes.figure.colorbar(drawn, ax=axes, shrink=0.8, label="force")
    draw_paths(axes, paths)
    turn = np.linspace(0, 2 * np.pi, 181)
    for radius, line, label in (
        (physics.field.radius, ":", f"r* = {physics.field.radius:g}"),
        (physics.orbit_radius, "-", f"orbit, {physics.orbit_radius:.3f}"),
    ):
        x, y = (c + radius * f(turn) for c, f in zip(physics.field.centre, (np.cos, np.sin), strict=True))
        axes.plot(x, y, line, color="#CC3311", linewidth=1.6, label=label, zorder=3)
    axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.02), ncols=2, fontsize=8)
    axes.set_title("the force" if force is not None else "paths from rest, no actions", fontsize=10)


def draw_limits(axes: Axes, values: Values, radius: float) -> None:
    """Radius of the orbit against the relative strength of the tangential part: formula and measurement."""
    part = np.linspace(0, 0.93, 200)
    axes.plot(part, 1 / (1 - part**2), color="0.3", label=r"$1/(1-k_1^2/k_2)$")
    count = len(values["share"])
    axes.plot(values["share"], values["measured"][:count] / radius, "o", color="#0061B0", label="measured")
    axes.axvline(1, color="#CC3311", linestyle="--", linewidth=1, label="no orbit beyond")
    axes.set(xlabel=r"$k_1/\sqrt{k_2}$", ylabel="radius of the orbit / r*", xlim=(0, 1.05), ylim=(0, 8))
    axes.set_title("mass and drag 1", fontsize=10)
    axes.legend(loc="upper left", fontsize=8)
