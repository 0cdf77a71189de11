"""Section 6.1.2: modules of predictors and controllers (MOSAIC) learn a simple decision in complex dynamics."""

import dataclasses
from collections.abc import Iterator
from typing import Any, ClassVar, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad.learning import SGD, Agent, Learner, olgarb
from motorgrad.policies import InitialHyperplanes, InitialMosaic, InitialTiles, Mosaic, hyperplanes
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of, median_of
from motorgrad.tasks import Task
from motorgrad.worlds import World
from motorgrad_thesis._claims import Claim, above, at_least
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, draw_intervals, new_figure
from motorgrad_thesis.chapter_6.figure_6_2 import DISTANT, NEAR, change, parts
from motorgrad_thesis.chapter_6.section_6_3_noise import SMOOTH, decisions_to, final_reward

PERIOD = 0.1  # s between two decisions
SIDE = np.pi / 2  # the greatest bearing
LEARNED = 0.9  # share of right decisions that counts as having learned
AS_WELL = 0.95  # of the share of right decisions at the end
GIVEN = 8  # predictors in the thesis
DEVIATION = 0.02  # of the noise on predictions; given ones are 0.045 rad apart
PICTURE = 121  # places along the line
BEARINGS = np.linspace(-SIDE, SIDE, PICTURE)
LINES = np.linspace(NEAR, DISTANT, PICTURE)
USUAL_RATES = {
    "one": {"weights": 1.0, "bias": 1.0},
    "local": {"centre": 2e-2, "log_width": 8e-2},
    "modules": {"weights": 1.0, "bias": 0.0},  # a bias that modules share is no part of them
}


class Approach(World):
    """An agent moves straight ahead, past a target at a bearing and a distance; actions change nothing."""

    reset_uniforms = 2

    def reset(self, uniforms: Float[Array, " 2"]) -> Float[Array, " 2"]:
        return jnp.stack([SIDE * (2 * uniforms[0] - 1), NEAR + (DISTANT - NEAR) * uniforms[1]])

    def step(self, state: Float[Array, " 2"], action: Array, uniforms: Array) -> Float[Array, " 2"]:
        del action, uniforms
        return state + PERIOD * change(state, jnp)


@dataclasses.dataclass(frozen=True)
class Braking(Task):
    """Brake while the target is near, whatever its bearing: the task of figure 6.2 of the thesis.

    Observed: bearing and distance. Action: it brakes if any unit fires. Reward: 1 for a right decision, else 0. An
    episode starts anywhere and ends when the target is passed or closer than the nearest start.
    """

    name: ClassVar[str] = "braking"
    episodic: ClassVar[bool] = True
    dynamics: ClassVar[World] = Approach()  # pyright: ignore[reportIncompatibleMethodOverride]
    observation_size: ClassVar[int] = 2  # pyright: ignore[reportIncompatibleMethodOverride]
    observation_range: ClassVar[Any] = ((-SIDE, SIDE), (NEAR, DISTANT))

    units: int = count(1, 1, 1_000, help="number of actions")
    brake: float = number(0.6, NEAR, DISTANT, help="the distance at which to brake")

    @property
    def action_size(self) -> int:
        return self.units

    def init(self, uniforms: Float[Array, " 0"]) -> Float[Array, ""]:
        """The distance at the last decision."""
        del uniforms
        return jnp.zeros(())

    def observe(
        self, memory: Float[Array, ""], state: Float[Array, " 2"], uniforms: Array
    ) -> tuple[Float[Array, ""], Float[Array, " 2"]]:
        return state[1], state

    def reward(
        self, memory: Float[Array, ""], state: Float[Array, " 2"], action: Float[Array, " units"]
    ) -> tuple[Float[Array, ""], Float[Array, ""], Any]:
        right = (jnp.max(action) > 0) == (memory < self.brake)
        passed = (jnp.abs(state[0]) > SIDE) | (state[1] < NEAR)
        return memory, right.astype(state.dtype), passed


class Kind(NamedTuple):
    """A kind of policy: description, and number of units."""

    words: str
    units: int


KINDS = {
    "one": Kind("one hyperplane", 1),
    "local": Kind("8 local units", 8),
    "given": Kind(f"{GIVEN} given predictors", 1),
    "learned 2": Kind("2 learned predictors", 1),
    "learned 8": Kind("8 learned predictors", 1),
}
RATES = {"one": 1.0, "local": 0.3, "given": 3.0, "learned 2": 1.0, "learned 8": 3.0}
"""Learning rates relative to `USUAL_RATES`: those by which each kind learns in the fewest decisions, of six from 0.1
to 30 (local units: four up to 3), over 8 other seeds."""
MODULAR = [name for name in KINDS if name not in ("one", "local")]


@experiment("sec-6.1.2-mosaic", "modules of predictors and controllers", "section 6.1.2")
class Modules(Experiment):
    """The task of figure 6.2: brake while a target is near, whatever its bearing. It is learned by one hyperplane; by
    local units; and by MOSAIC, whose hyperplanes act as far as the predictor beside each of them predicts the next
    observation well: with the eight given predictors of the figure, and with two and eight that learn.
    """

    decisions: int = count(40_000, 1_000, 10**8, help="number of decisions of learning")
    seeds: int = count(24, 2, 10_000, help="number of learners of each kind")

    quick = smoke(decisions=2_000, seeds=3)

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for name, kind in KINDS.items():
            task = Braking(units=kind.units)
            run = work.train(task, learner(name, task, RATES[name]), self.decisions, self.seeds)
            found["decision"], found[name] = run.curve()
            if name in MODULAR:
                policies: Any = run.policies
                predictors = np.asarray(policies.predictors)
                along = [responsible(each, task.brake, task.brake) for each in predictors]
                found[f"{name} parts"] = np.array([len(parts(best)) for best in along])
                found[f"{name} best"] = np.stack([responsible(predictors[0], line, task.brake) for line in LINES])
        return found

    def figure(self, values: Values) -> Figure:
        figure = new_figure(10.5, 3.6)
        curves, times, *planes = figure.subplots(1, 4, width_ratios=[1.5, 1, 1, 1])
        thousand = values["decision"] / 1000
        smooth = min(SMOOTH, len(thousand))
        for rank, (name, kind) in enumerate(KINDS.items()):
            draw_band(curves, thousand, values[name], f"C{rank}", kind.words, records=smooth)
            time = median_of(self._times(values, name) / 1000)
            draw_intervals(times, [rank], [time], across=True, fmt="o", color=f"C{rank}")
        curves.set(xlabel="thousand decisions", ylabel="share of right decisions")
        curves.legend(loc="lower right", fontsize=7.5)
        times.set(xlabel=f"thousand decisions to {LEARNED:.0%}", yticks=range(len(KINDS)))
        times.set_yticklabels([kind.words for kind in KINDS.values()], fontsize=7.5)
        times.invert_yaxis()
        for axes, name in zip(planes, ("given", "learned 8"), strict=True):
            axes.pcolormesh(BEARINGS, LINES, values[f"{name} best"], cmap="tab20", alpha=0.5, rasterized=True)
            axes.axhline(Braking().brake, color="#c8452f", linewidth=2.2, linestyle="--")
            axes.set_title(KINDS[name].words, fontsize=9)
            axes.set(xlabel="bearing (rad)", ylabel="distance")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        one = np.median(self._times(values, "one"))
        for name in ("given", "learned 8"):
            times = self._times(values, name)
            yield above(
                1,
                f"Dividing control among modules slows learning ({KINDS[name].words}).",
                median_of(times / one),
                f"decisions to {LEARNED:.0%} right ones, relative to the median of one hyperplane,",
                "times",
                note=f"Medians {np.median(times):,.0f} and {one:,.0f}.",
                of="Dividing control among modules slows learning.",
            )
        few = np.median(self._times(values, "learned 2"))
        yield above(
            1,
            "It slows learning the more, the more modules there are.",
            median_of(self._times(values, "learned 8") / few),
            f"decisions to {LEARNED:.0%} of 8 learned predictors, relative to the median of 2,",
            "times",
            kind="extension",
        )
        yield above(
            1,
            "Modules learn more slowly than local units.",
            median_of(self._times(values, "given") / np.median(self._times(values, "local"))),
            f"decisions to {LEARNED:.0%} of {GIVEN} given predictors, relative to the median of local units,",
            "times",
            kind="extension",
        )
        yield above(
            1,
            "Learned predictors divide the boundary, too.",
            mean_of(values["learned 8 parts"]),
            "segments of the boundary with the same best predictor, of 8,",
            "parts",
        )
        final = {name: final_reward(values[name]) for name in ("one", "given", "learned 8")}
        for name in ("given", "learned 8"):
            yield at_least(
                AS_WELL,
                f"In the end, modules decide as well as one controller ({KINDS[name].words}).",
                mean_of(final[name] / final["one"].mean()),
                "share of right decisions in the last tenth, relative to that of one hyperplane",
                note=f"{final[name].mean():.3f} and {final['one'].mean():.3f}.",
                of="In the end, modules decide as well as one controller.",
            )

    @staticmethod
    def _times(values: Values, name: str) -> np.ndarray:
        return decisions_to(values["decision"], values[name], LEARNED)


def given_predictors() -> Mosaic:
    """Modules with the predictors of figure 6.2, which do not learn: equal changes of distance, and changes of bearing
    spread evenly."""
    predictors = np.zeros((GIVEN, 2, 4))
    predictors[:, 0, -1] = PERIOD * np.linspace(-SIDE, SIDE, GIVEN)
    return Mosaic(
        hyperplanes(3 * GIVEN, 1), jnp.asarray(predictors, jnp.float32), jnp.asarray(DEVIATION), jnp.asarray(0.0)
    )


def learner(name: str, task: Any, rate: float) -> Learner:
    """The learner of a kind of policy, with a multiple of the usual rates."""
    if name == "given":
        policy: Any = given_predictors()
    elif name in MODULAR:
        policy = InitialMosaic(modules=int(name.split()[1]), deviation=DEVIATION, spread=PERIOD).bound(task)
    else:
        policy = (InitialTiles() if name == "local" else InitialHyperplanes()).bound(task)
    rates = {group: rate * usual for group, usual in USUAL_RATES["modules" if name in MODULAR else name].items()}
    return Agent(policy, olgarb(0.0), SGD(rates))


def responsible(predictors: np.ndarray, distance: float, brake: float) -> np.ndarray:
    """The predictor that is the best after a right decision, at each of the bearings at a distance."""
    places = np.stack([BEARINGS, np.full(PICTURE, distance)], axis=-1)
    acts = np.full((PICTURE, 1), float(distance < brake))
    seen = np.concatenate([places, acts, np.ones((PICTURE, 1))], axis=-1)
    error = np.einsum("mor,pr->pmo", predictors, seen) - PERIOD * change(places)[:, None]
    return (error**2).sum(-1).argmin(-1)
