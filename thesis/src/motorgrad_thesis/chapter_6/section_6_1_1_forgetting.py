"""Section 6.1.1: how much learning in one region impairs another."""

import dataclasses
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, ClassVar, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies import with_interface
from motorgrad.schema import Range, count, static
from motorgrad.statistics import mean_of
from motorgrad.tasks import FallingParticle
from motorgrad.training import Run, agent_for
from motorgrad.worlds import ParticleStart, ParticleState
from motorgrad_thesis._claims import Claim, at_least, at_most, more_than_half, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Figure, draw_band, subplots
from motorgrad_thesis.chapter_6._local_study import LocalStudy, frozen_reward, late_reward

KEPT = 0.1  # a policy that loses at most this fraction of its gain does not forget
CHECKS = 8  # records of each phase at which policies are evaluated
EVALUATION_DECISIONS = 5_000
INWARD = 0.15  # distance from the end of a side's starts to its goal
SMOOTH = 5  # records over which the learner's reward is averaged


@dataclasses.dataclass(frozen=True)
class Powers(FallingParticle):
    """The falling particle with its position observed as $u, v, u^2, uv, v^2$, where $u = 2x - 1$ and $v = 2y - 1$, for
    global policies with curved boundaries.

    A hyperplane in these is a conic in the plane: a line, a circle, or a hyperbola. Everything else is as in
    `FallingParticle`.
    """

    name: ClassVar[str] = "particle-powers"

    @property
    def observation_size(self) -> int:
        return 5

    @property
    def observation_range(self) -> tuple[tuple[float, float], ...]:
        return ((-1.0, 1.0),) * 2 + ((0.0, 1.0), (-1.0, 1.0), (0.0, 1.0))

    def observe(
        self, memory: Any, state: ParticleState, uniforms: Float[Array, " uniforms"]
    ) -> tuple[Any, Float[Array, " observation_size"]]:
        memory, seen = FallingParticle.observe(self, memory, state, uniforms)
        u = 2 * seen[0] - 1
        v = 2 * seen[1] - 1
        return memory, jnp.stack([u, v, u * u, u * v, v * v])


class Kind(NamedTuple):
    """A kind of policy: description, task, number of units, and changes to the task's own learner."""

    words: str
    task: type[FallingParticle]
    units: int
    changes: Mapping[str, Any]


GLOBAL = {"policy": "hyperplanes", "learning_rate": 0.1}
"""At the best of several rates from 0.003 to 0.3 for either kind, over 24 other seeds, with each side learned alone."""


NARROW = {"policy": {"copies": 2, "width": 0.08}}


POLICY_KINDS = {
    "local": Kind("local: 8 Gaussians, σ = 0.16", FallingParticle, 8, {}),
    "narrow": Kind("local: 32 Gaussians, σ = 0.08", FallingParticle, 32, NARROW),
    "linear": Kind("global: 8 hyperplanes", FallingParticle, 8, GLOBAL),
    "quadratic": Kind("global: 8 quadratic boundaries", Powers, 8, GLOBAL),
}


LOCAL = ("local", "narrow")
FAR = ("linear", "quadratic")


@experiment("sec-6.1.1-forgetting", "catastrophic forgetting", "section 6.1.1")
class Forgetting(LocalStudy):
    """A particle that starts on the left (A) learns to fall through a goal there; then it starts on the right (B),
    where there is another goal. What remains of the first is evaluated without learning. Local units of two widths are
    compared with hyperplanes on the same inputs, and also on their squares and product, each at its best rate.
    """

    reading: ClassVar[str] = "The thesis describes no experiment; tasks, gaps and global policies are ours."

    decisions: int = count(50_000, 1_000, 10**8, help="number of decisions of learning on each side")
    kinds: tuple[Literal["local", "narrow", "linear", "quadratic"], ...] = static(
        tuple(POLICY_KINDS), help="kinds of policies, `local` among them"
    )
    gaps: tuple[float, ...] = static(
        (0.2, 0.4),
        allowed=Range(0, 0.6),
        help="gaps between the starts on the left and those on the right, as fractions of the box; the smallest first",
    )

    def validate(self) -> None:
        super().validate()
        once = len(set(self.kinds)) == len(self.kinds) and "local" in self.kinds
        check(once, "kinds", self.kinds, "different ones, local among them")
        self.check_rising("gaps")

    quick = smoke(decisions=1_000, seeds=3, kinds=("local", "linear"), gaps=(0.2,))

    def run(self, work: Workspace) -> Values:
        found: Values = {}
        for gap in self.gaps:
            for name in self.kinds:
                learned = self._learned_in_turn(work, POLICY_KINDS[name], gap)
                found |= {f"{gap:g} {name} {key}": value for key, value in learned.items()}
        return found

    def _learned_in_turn(self, work: Workspace, kind: Kind, gap: float) -> Values:
        """Rewards on A of frozen policies, `(checks, seeds)`: before learning, while learning A, and while learning B;
        and rewards of the learner on B, `(seeds, records)`."""
        sides = [_task(kind, gap, side) for side in "AB"]
        first = self.learned(work, sides[0], **kind.changes)
        settings = agent_for(sides[1], **kind.changes)
        second = work.train(sides[1], settings, self.decisions, self.seeds, first.policies)
        checked = [run.policies_at(_checks(run)) for run in (first, second)]
        way = _together([with_interface(first.initial, None), *(jax.tree.map(_flat, policies) for policies in checked)])
        reward = frozen_reward(work, sides[0], way, min(EVALUATION_DECISIONS, self.decisions), **kind.changes)
        times = [n * self.decisions + run.curve()[0][_checks(run)] for n, run in enumerate((first, second))]
        return {
            "checked": np.concatenate([[0], *times]),
            "A": reward.reshape(-1, self.seeds),
            "decision": self.decisions + second.curve()[0],
            "B": second.curve()[1],
            "B gain": late_reward(second) - second.curve()[1][:, :2].mean(1),
        }

    def figure(self, values: Values) -> Figure:
        """For every kind of policy and gap: reward of frozen policies on A while first A and then B is learned, and
        reward of the learner on B."""
        words = {name: POLICY_KINDS[name].words for name in self.kinds}
        figure, grid = subplots(
            2.6 * len(words),
            0.6 + 2.5 * len(self.gaps),
            len(self.gaps),
            len(words),
            sharex=True,
            sharey=True,
            squeeze=False,
        )
        for number, (row, gap) in enumerate(zip(grid, self.gaps, strict=True)):
            for panel, (name, title) in zip(row, words.items(), strict=True):
                key = f"{gap:g} {name}"
                draw_band(
                    panel,
                    values[f"{key} checked"] / 1000,
                    values[f"{key} A"].T,
                    "C0",
                    "on the left (A), frozen",
                    mean=True,
                )
                decision = values[f"{key} decision"]
                reward = values[f"{key} B"]
                kept = len(decision) // SMOOTH * SMOOTH
                smooth = reward[:, :kept].reshape(len(reward), -1, SMOOTH).mean(2)
                draw_band(
                    panel,
                    decision[SMOOTH - 1 : kept : SMOOTH] / 1000,
                    smooth,
                    "C1",
                    "on the right (B), learning",
                    mean=True,
                )
                half = values[f"{key} checked"][-1] / 2000
                panel.axvline(half, color="0.7", linewidth=0.8, linestyle="--")
                for at, phase in ((half / 2, "learns A"), (1.5 * half, "learns B")):
                    where = {"xycoords": ("data", "axes fraction"), "ha": "center", "va": "top"}
                    panel.annotate(phase, (at, 0.99), color="0.4", fontsize=8.5, **where)
                if number == 0:
                    panel.set_title(title, fontsize=9)
            row[0].set_ylabel(f"gap {gap:g}\nreward per decision")
        for panel in grid[-1]:
            panel.set_xlabel("thousand decisions")
        low, high = grid[0, 0].get_ylim()
        grid[0, 0].set_ylim(low, high + 0.08 * (high - low))
        figure.legend(*grid[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=2, fontsize=9)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        for gap in self.gaps:
            yield from _claims(values, gap, self.kinds)


def reward_gained(values: Values, gap: float, name: str) -> np.ndarray:
    """Reward on A gained by learning A, for each seed."""
    reward = values[f"{gap:g} {name} A"]
    return reward[len(reward) // 2] - reward[0]


def reward_lost(values: Values, gap: float, name: str) -> np.ndarray:
    """Reward on A lost by learning B, for each seed."""
    reward = values[f"{gap:g} {name} A"]
    return reward[len(reward) // 2] - reward[-1]


def _claims(values: Values, gap: float, kinds: Sequence[str]) -> Iterator[Claim]:
    shares = {name: mean_of(reward_lost(values, gap, name) / reward_gained(values, gap, name).mean()) for name in kinds}
    gains = {
        name: [mean_of(reward_gained(values, gap, name)), mean_of(values[f"{gap:g} {name} B gain"])] for name in kinds
    }
    apart = f"(gap {gap:g})"
    yield positive(
        f"Every kind learns both sides in turn {apart}.",
        min((each for pair in gains.values() for each in pair), key=lambda each: each.low),
        "least gain on the side that is being learned",
        "per decision",
        note="Gain on A: "
        + ", ".join(f"{POLICY_KINDS[name].words} {pair[0].value:.3f}" for name, pair in gains.items())
        + ".",
        kind="extension",
        source="a condition of the comparison",
    )
    if "quadratic" in kinds:
        yield _as_well(values, gap, apart)
    for name in (name for name in LOCAL if name in kinds):
        yield at_most(
            KEPT,
            f"Learning in one region does not affect another {apart}: {POLICY_KINDS[name].words}.",
            shares[name],
            "fraction of the gain on A lost while learning B",
            "of the gain",
            kind=whose(name),
            of="With local units, learning in one region does not affect another.",
        )
    for name in (name for name in FAR if name in kinds):
        yield positive(
            f"Global policies forget {apart}: {POLICY_KINDS[name].words}.",
            shares[name],
            "fraction of the gain on A lost while learning B",
            "of the gain",
            kind=whose(name),
            of="Global policies forget.",
        )
        yield more_than_half(
            f"They forget most {apart}: {POLICY_KINDS[name].words}.",
            shares[name],
            "fraction of the gain on A lost while learning B",
            "of the gain",
            kind="extension",
        )
        for local in (local for local in LOCAL if local in kinds):
            yield positive(
                f"They lose more than local ones {apart}: {POLICY_KINDS[name].words}, {POLICY_KINDS[local].words}.",
                mean_of(reward_lost(values, gap, name) - reward_lost(values, gap, local)),
                "reward lost on A minus the loss of local units",
                "per decision",
                kind="thesis" if whose(name) == whose(local) == "thesis" else "extension",
                of="Global policies forget more than local ones.",
            )


def whose(name: str) -> Literal["thesis", "extension"]:
    """Whose statement a claim about a kind of policy is: narrow units and quadratic boundaries are ours."""
    return "thesis" if name in ("local", "linear") else "extension"


def _as_well(values: Values, gap: float, apart: str) -> Claim:
    """Whether the richer global policy is a fair competitor."""
    half = len(values[f"{gap:g} local A"]) // 2
    return at_least(
        0.95,
        f"Quadratic boundaries learn one side as well as local units do {apart}.",
        mean_of(values[f"{gap:g} quadratic A"][half] / values[f"{gap:g} local A"][half].mean()),
        "reward on A after learning A, relative to the mean of eight local units,",
        kind="extension",
        source="a condition of the comparison",
    )


def _task(kind: Kind, gap: float, side: str) -> FallingParticle:
    """One side of the task; both goals are always present."""
    end = 0.5 - gap / 2
    goals = tuple((1.0, x, 0.35, 0.1, 0.1) for x in (end - INWARD, 1 - end + INWARD))
    start = ParticleStart(x=(0.0, end) if side == "A" else (1 - end, 1.0))
    return kind.task(units=kind.units, regions=goals, start=start)


def _checks(run: Run) -> np.ndarray:
    """Records at which a phase is evaluated, including the last."""
    count = len(run.curve()[0])
    return np.linspace(0, count - 1, min(CHECKS, count) + 1).round().astype(int)[1:]


def _flat(leaf: Any) -> Any:
    """Records and seeds as one axis."""
    return leaf.reshape(-1, *leaf.shape[2:])


def _together(policies: Sequence[Any]) -> Any:
    return jax.tree.map(lambda *leaves: jnp.concatenate([jnp.asarray(leaf) for leaf in leaves]), *policies)
