"""Section 5.4.1: motor primitives whose preconditions and movement parameters are learned together."""

from collections.abc import Iterator
from typing import Any, ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.bodies import LEGS, TRIPODS
from motorgrad.learning import Learner
from motorgrad.policies import Primitives
from motorgrad.schema import count, number
from motorgrad.statistics import mean_of, share_of
from motorgrad.tasks import HexapodPrimitive
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, more_than_half, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, subplots
from motorgrad_thesis.chapter_5.extensions._muscle_study import frozen_readings

LEARNED_PART_LABELS = {
    "both": "precondition and movement learned together",
    "precondition": "the precondition alone",
    "movement": "the movement alone",
}
STILL = 0.021
"""The deviation of a movement that is not learned: close to none."""

SURE = 7.0
"""The negative logarithm of a deviation that adds almost nothing to the floor."""

RECORDS = 60
CELLS = 41  # along each side of the picture of a precondition
MEMBERS = np.array([[leg in tripod for leg in LEGS] for tripod in TRIPODS])
COLOURS = {"both": "C0", "precondition": "C2", "movement": "C1"}
TRIPOD = ("first", "second")


@experiment("sec-5.4.1-primitive", "motor primitives: when they begin and how they move", "section 5.4.1")
class LearnedPrimitives(Experiment):
    """A hexapod walks by steps of its two tripods: motor primitives, each a swing and a stance. The start of a step
    (its precondition) and the durations of its parts (its movement parameters) are learned together from zero weights;
    or one of them alone, while the other keeps its initial form: random starts of steps, or initial durations.
    """

    first_seed: ClassVar[int] = 100
    """Some of the earlier seeds were used to choose the settings."""

    seconds: float = number(400.0, 0, open_low=True, unit="simulated s", help="length of every hexapod's practice")
    seeds: int = count(20, 2, 10_000, help="number of hexapods of each kind")
    watched: float = number(
        10.0,
        0,
        3600,
        open_low=True,
        unit="simulated s",
        help="length of the evaluation of the learned policies, without learning",
    )

    def validate(self) -> None:
        super().validate()
        self.check_least(seconds=RECORDS * self.task.period, watched=self.task.period)

    quick = smoke(seconds=2.4, seeds=2, watched=0.4)

    @property
    def task(self) -> HexapodPrimitive:
        return HexapodPrimitive()

    def learner(self, kind: str) -> Learner:
        """The task's own learner, with step sizes of 0 for what is not learned."""
        rates: dict[str, float] = dict(self.task.learner["learning_rate"])
        changes: dict[str, Any] = {}
        if kind == "precondition":
            rates |= {"movement.bias": 0.0}
            changes = {"policy.deviation": STILL}
        elif kind == "movement":
            rates |= {"precondition.weights": 0.0, "precondition.bias": 0.0}
        return agent_for(self.task, learning_rate=rates, **changes)

    def run(self, work: Workspace) -> Values:
        task = self.task
        found = {}
        seeds = list(range(self.first_seed, self.first_seed + self.seeds))
        for kind in LEARNED_PART_LABELS:
            run = work.train(task, self.learner(kind), round(self.seconds / task.period), seeds)
            decision, speed = run.curve("speed")
            found |= {"time": decision * task.period, f"{kind} curve": speed}
            seen = work.part(kind, lambda run=run: self._watch(work, run.policies))
            found[f"{kind} speed"] = seen["speed"]
            sure = work.part(f"{kind} sure", lambda run=run: self._watch(work, _sure(run.policies)))
            found[f"{kind} sure"] = sure["speed"]
            if kind == "both":
                found |= self._learned(run.policies, int(np.argsort(seen["speed"])[self.seeds // 2]))
        return found

    def _watch(self, work: Workspace, policies: Any) -> Values:
        return frozen_readings(work, policies, self.task, self.watched, "sample", ("speed",))

    def _learned(self, policies: Any, middle: int) -> Values:
        """Parameters of all seeds; and, for the median one, the preconditions."""
        weights = np.asarray(policies.precondition.weights)
        level = jnp.asarray(policies.movement.bias)
        lasting = self.task.lasting(jnp.concatenate([jnp.zeros((len(level), len(TRIPODS))), level], axis=1))
        own = np.stack([weights[:, each][:, MEMBERS[each]].sum(1) for each in range(len(TRIPODS))], axis=1)
        other = np.stack([weights[:, each][:, ~MEMBERS[each]].sum(1) for each in range(len(TRIPODS))], axis=1)
        policy = jax.tree.map(lambda leaf: leaf[middle], policies)
        begins = precondition(policy, self._angles())
        return {"lasting": np.asarray(lasting), "own": own, "other": other, "begins": begins, "angles": self._angles()}

    def _angles(self) -> np.ndarray:
        return np.linspace(-1.0, 1.0, CELLS) * 30.0 / self.task.angle_scale

    def figure(self, values: Values) -> Figure:
        """Learning curves; durations of the parts of a step; and the preconditions of one hexapod."""
        start = (self.task.swing, self.task.stance)
        figure, panels = subplots(10, 7.6, 2, 2)
        records = max(1, len(values["time"]) // 20)
        for kind, label in LEARNED_PART_LABELS.items():
            draw_band(panels[0, 0], values["time"], values[f"{kind} curve"], COLOURS[kind], label, records=records)
        panels[0, 0].set(xlabel="simulated s of practice", ylabel="speed while learning, m/s")
        panels[0, 0].set_ylim(0, 1.3 * panels[0, 0].get_ylim()[1])
        panels[0, 0].legend(loc="upper left", fontsize=8.5)
        _movements(panels[0, 1], values, start)
        shown: Any = None
        for tripod, axes in enumerate(panels[1]):
            shown = _precondition(axes, values, tripod, self.task.angle_scale)
        figure.colorbar(
            shown, ax=panels[1], location="bottom", shrink=0.5, label="probability per decision of starting a step"
        )
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for kind, words in LEARNED_PART_LABELS.items():
            curve = values[f"{kind} curve"]
            part = max(1, curve.shape[1] // 20)
            yield positive(
                f"Learning {words.removesuffix(' learned together')} makes the hexapod faster.",
                mean_of(curve[:, -4 * part :].mean(1) - curve[:, :part].mean(1)),
                "the last fifth of the practice minus the first twentieth",
                "m/s",
                kind="thesis" if kind == "both" else "extension",
                of="Preconditions and movements can be learned at the same time.",
            )
        for kind in ("precondition", "movement"):
            sure = mean_of(values["both sure"] - values[f"{kind} sure"])
            speeds = f"{values['both speed'].mean():.2f} m/s and {values[f'{kind} speed'].mean():.2f} m/s."
            yield positive(
                f"Learning both together leads to faster walks than {LEARNED_PART_LABELS[kind]}.",
                mean_of(values["both speed"] - values[f"{kind} speed"]),
                "frozen after learning, paired by seed: difference",
                "m/s",
                note=f"{speeds} With mean movements instead of sampled ones, the difference is {sure}.",
                of="Learning preconditions and movements at the same time is better than either alone.",
            )
        yield more_than_half(
            "A tripod learns to start a step when its own legs are back, rather than the other tripod's.",
            share_of((values["own"] < 0).all(1) & (values["other"] > values["own"]).all(1)),
            "share of seeds whose weights of its own legs sum to less than 0 and less than the others', for both "
            "tripods,",
            kind="extension",
        )


def _sure(policies: Any) -> Any:
    """The same policies with almost no noise in their movement."""
    return eqx.tree_at(lambda each: each.movement.log_deviation, policies, replace_fn=lambda noise: 0 * noise - SURE)


def precondition(policy: Primitives, angles: np.ndarray) -> np.ndarray:
    """Probability that each tripod starts a step, if it can, over the lateral angle of its own legs and that of the
    others, all legs of a tripod alike: `(tripods, others, own)`."""
    own, other = np.meshgrid(angles, angles)
    places = []
    for each in range(len(TRIPODS)):
        legs = np.where(MEMBERS[each], own[..., None], other[..., None]).reshape(-1, len(LEGS))
        p = jax.vmap(policy.precondition.prob)(jnp.asarray(legs, jnp.float32))
        places.append(np.asarray(p)[:, each].reshape(own.shape))
    return np.stack(places)


def _movements(axes: Axes, values: Values, start: tuple[float, float]) -> None:
    for tripod, marker in enumerate("os"):
        swing, stance = values["lasting"][:, tripod].T
        axes.plot(swing, stance, marker, markersize=4, alpha=0.8, label=f"{TRIPOD[tripod]} tripod")
    axes.plot(*start, "k+", markersize=12, label="initially")
    axes.set(xlabel="duration of the swing, s", ylabel="duration of the stance, s", xlim=(0, None), ylim=(0, None))
    axes.legend(fontsize=8.5)


def _precondition(axes: Axes, values: Values, tripod: int, angle_scale: float) -> Any:
    degrees = values["angles"] * angle_scale
    ends = (degrees[0], degrees[-1])
    begins = values["begins"][tripod]
    shown = axes.imshow(begins, origin="lower", extent=(*ends, *ends), aspect="auto", vmin=0, vmax=1)
    lines = axes.contour(degrees, degrees, begins, levels=np.array([0.25, 0.5, 0.75]), colors="white", linewidths=0.8)
    axes.clabel(lines, fontsize=8)
    axes.set(
        title=f"{TRIPOD[tripod]} tripod, median seed",
        xlabel="lateral angle of its own legs, degrees (forward +)",
        ylabel="of the other tripod's legs",
    )
    return shown
