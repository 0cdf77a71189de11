"""Section 6.5.4: sub-policies that act only while the unit above them fires."""

from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.learning import Learner
from motorgrad.plane import draw_paths, draw_reward
from motorgrad.policies import Gated, Policy, split
from motorgrad.schema import count
from motorgrad.statistics import mean_of
from motorgrad.tasks import FallingParticle, Region
from motorgrad.training import agent_for
from motorgrad_thesis._claims import Claim, above, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_band, new_figure
from motorgrad_thesis.chapter_6._local_study import EXACT_READ, median_row, policy_at, prefixed, stored_paths

LEFT = (-0.4, 0.0)
RIGHT = (0.4, 0.0)
NONE = (0.0, 0.0)
LINES: tuple[Region, ...] = ((1.0, 0.25, 0.65, 0.06, 0.15), (1.0, 0.75, 0.15, 0.06, 0.15))
"""Two vertical lines of reward, one above on the left and one below on the right: the right action depends on the
height."""

RATES = {"centre": 2e-4, "log_width": 8e-4, "weights": 1.6e-2, "bias": 1.6e-2}
END = 0.05  # share of the decisions, the last, over which the end is averaged
GRID = 61
FORCES = {
    "ungated": (LEFT, RIGHT),
    "gated": (NONE,) * 2 + (LEFT, RIGHT) * 2,
    "deep": (NONE,) * 2 + ((NONE,) * 2 + (LEFT, RIGHT) * 2) * 2,
}
"""Force of each unit, in the order of an action; gates do not push."""

POLICY_LABELS = {
    "ungated": "two hyperplanes for the whole box",
    "gated": "two gates, two hyperplanes behind each",
    "flat gated": "local units, equally many parameters",
    "deep": "two gates behind each of two gates, two hyperplanes behind each",
    "flat deep": "local units, as many parameters as that",
}
GATES: dict[str, dict[str, Any]] = {"gated": {"gates": 2}, "deep": {"gates": 2, "levels": 2}}
SMOOTH = 10  # records
CURVES = {
    "ungated": ("0.5", "-"),
    "gated": ("C0", "-"),
    "flat gated": ("C0", ":"),
    "deep": ("C3", "-"),
    "flat deep": ("C3", ":"),
}
LEVELS = ("#222222", "#B07500")


USEFUL = "Hierarchies of gates and sub-policies are useful."


@experiment("sec-6.5.4-hierarchy", "sub-policies behind gates", "section 6.5.4")
class Hierarchy(Experiment):
    """A hierarchy of gates, local units in the plane of the falling particle, each with two hyperplane units behind it
    that push left and right only while the gate fires; and one with gates behind gates. All are learned together, in a
    layout that requires different actions above and below. For comparison, the same two units without gates, and pools
    of local units with equally many parameters.
    """

    reading: ClassVar[str] = EXACT_READ

    decisions: int = count(200_000, 400, 10**9, help="number of decisions of learning")
    seeds: int = count(24, 2, 10_000, help="number of learners of each kind")
    drawn: int = count(10, 1, 1_000, help="number of episodes whose paths are in each picture")

    quick = smoke(decisions=2_000, seeds=3, drawn=3)

    def learner(self, name: str) -> tuple[FallingParticle, Learner]:
        """A task with the forces of a policy's units, and the policy's learner."""
        if name.startswith("flat "):
            count = round(parameter_count(self.learner(name.removeprefix("flat "))) / 4)
            task = FallingParticle(regions=LINES, units=count)
            return task, agent_for(task, policy={"copies": 1, "width": 0.3})
        forces = FORCES[name]
        task = FallingParticle(regions=LINES, units=len(forces), forces=forces)
        policy = {"kind": "gated", **GATES[name]} if name in GATES else "hyperplanes"
        rates = RATES if name in GATES else {group: RATES[group] for group in ("weights", "bias")}
        return task, agent_for(task, policy=policy, learning_rate=rates)

    def run(self, work: Workspace) -> Values:
        found: Values = {"parameters": np.array([parameter_count(self.learner(name)) for name in POLICY_LABELS])}
        for name in POLICY_LABELS:
            task, settings = self.learner(name)
            run = work.train(task, settings, self.decisions, self.seeds)
            found["decision"], reward = run.curve()
            late = found["decision"] > (1 - END) * found["decision"][-1]
            found |= {f"{name} reward": reward, f"{name} end": reward[:, late].mean(1)}
            if name not in GATES:
                continue
            policies: Any = run.policies
            before: Any = run.initial
            found[f"{name} moved"] = np.linalg.norm(policies.gate.centre - before.gate.centre, axis=-1).mean(1)
            if name == "gated":
                found["turned"] = gate_difference(policies)
            row = median_row(found[f"{name} end"])
            policy = policy_at(policies, row)
            shown = {"row": np.array(row), **stored_paths(task, policy, self.drawn), **gate_maps(policy)}
            found |= prefixed(name, shown)
        return found

    def figure(self, values: Values) -> Figure:
        """For each hierarchy: its gates with paths, and activity and push of each pool at its end; learning curves of
        all policies."""
        tasks = {name: self.learner(name)[0] for name in GATES}
        figure = new_figure(11, 7.2)
        halves: Any = figure.subfigures(2, 1, height_ratios=[1.65, 1])
        above, below = halves
        shown: Any = None
        rows: Any = above.subplots(len(tasks), 5)
        for axes, (name, task) in zip(rows, tasks.items(), strict=True):
            pools = len(values[f"{name} open"])
            _draw_gates(axes[0], values, name, task)
            axes[0].set_title(
                f"{len(values[f'{name} level'])} gates, paths: seed {int(values[f'{name} row'])}", fontsize=9
            )
            for number, panel in enumerate(axes[1:]):
                if number >= pools:
                    panel.set_axis_off()
                    continue
                shown = _draw_pool(panel, values[f"{name} open"][number], values[f"{name} push"][number])
                panel.set_title(f"pool {number + 1} of {pools}", fontsize=9)
        above.colorbar(shown, ax=rows, shrink=0.6, label="push to the right ×\nopening of the gates")
        _draw_curves(below.subplots(), values, POLICY_LABELS)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        ends = {name: values[f"{name} end"] for name in POLICY_LABELS}
        counts = dict(zip(POLICY_LABELS, values["parameters"], strict=True))
        for better, worse, statement, source in (
            ("gated", "ungated", "Gates are useful: actions are learned separately in each region.", "section 6.5.4"),
            ("deep", "gated", "Gates behind gates are useful, too.", "section 6.5.4"),
            (
                "gated",
                "flat gated",
                "A hierarchy learns better than one pool with equally many parameters.",
                "section 6.5.4",
            ),
            ("deep", "flat deep", "So does a hierarchy of two levels.", "section 6.5.4"),
        ):
            yield positive(
                statement,
                mean_of(ends[better] - ends[worse]),
                f"final reward: {POLICY_LABELS[better]}, minus {POLICY_LABELS[worse]},",
                "reward per decision",
                note=f"{ends[better].mean():.3f} with {counts[better]} parameters, {ends[worse].mean():.3f} with "
                f"{counts[worse]}.",
                source=f"{source}, which proposes hierarchies",
                kind="extension" if "flat" in worse else "thesis",
                of=USEFUL,
            )
        yield above(
            0.05,
            "Gates are learned: they move to their regions.",
            mean_of(values["gated moved"]),
            "mean distance moved",
            "of the box",
        )
        yield above(
            0.1,
            "Different actions are learned behind each gate.",
            mean_of(values["turned"]),
            "mean difference between the pushes of the two pools at the same places",
            "of the force",
        )


def parameter_count(learner: tuple[FallingParticle, Learner]) -> int:
    """Number of learned parameters."""
    policy: Any = learner[1].policy(jax.random.key(0))
    return sum(leaf.size for leaf in jax.tree.leaves(split(policy)[0]))


def push(branch: Policy, places: Any) -> np.ndarray:
    """Push of a pool with one unit to the left and one to the right, from −1 to 1, `(places,)`."""
    fires = np.asarray(jax.vmap(branch.prob)(jnp.asarray(places, jnp.float32)))
    return fires[:, 1] - fires[:, 0]


def gate_difference(policies: Any) -> np.ndarray:
    """Mean difference over the box between the pushes of the two pools behind two gates, `(seeds,)`."""
    found = []
    for row in range(len(policies.gate.centre)):
        first, second = (push(branch, grid()) for branch in policy_at(policies, row).branches)
        found.append(np.abs(first - second).mean())
    return np.array(found)


def grid() -> np.ndarray:
    """Places on a grid over the box, `(places, 2)`."""
    side = np.linspace(0, 1, GRID)
    return np.stack(np.meshgrid(side, side), axis=-1).reshape(-1, 2)


def gate_maps(policy: Gated) -> Values:
    """For every pool of units at the end of a hierarchy: how far its gates are open, and its push; and centres and
    widths of all gates by level."""
    pools = list(_leaves(policy, np.ones(GRID**2)))
    gates = list(_gates(policy, 0))
    return {
        "open": np.stack([open_ for open_, _ in pools]).reshape(-1, GRID, GRID),
        "push": np.stack([pushes for _, pushes in pools]).reshape(-1, GRID, GRID),
        "level": np.concatenate([np.full(len(centre), level) for level, centre, _ in gates]),
        "centre": np.concatenate([centre for _, centre, _ in gates]),
        "width": np.concatenate([width for _, _, width in gates]),
    }


def _leaves(policy: Any, above: np.ndarray) -> Any:
    fires = np.asarray(jax.vmap(policy.gate.prob)(jnp.asarray(grid(), jnp.float32)))
    for gate, branch in enumerate(policy.branches):
        open_ = above * fires[:, gate]
        if isinstance(branch, Gated):
            yield from _leaves(branch, open_)
        else:
            yield open_, push(branch, grid())


def _gates(policy: Any, level: int) -> Any:
    yield level, np.asarray(policy.gate.centre), np.exp(np.asarray(policy.gate.log_width))
    for branch in policy.branches:
        if isinstance(branch, Gated):
            yield from _gates(branch, level + 1)


def _draw_gates(axes: Axes, values: Values, name: str, task: FallingParticle) -> None:
    """The reward, paths, and each gate's ellipse of one width, by level."""
    from matplotlib.patches import Ellipse

    draw_reward(axes, task)
    draw_paths(axes, np.split(values[f"{name} paths"], values[f"{name} ends"][:-1]))
    rows = zip(*(values[f"{name} {part}"] for part in ("level", "centre", "width")), strict=True)
    for level, centre, width in rows:
        ellipse = Ellipse(tuple(centre), *(2 * width), fill=False, color=LEVELS[level % 2], linewidth=2 - level % 2)
        axes.add_patch(ellipse)


def _draw_pool(axes: Axes, opened: np.ndarray, push: np.ndarray) -> Any:
    """Push of a pool to the left (blue) and to the right (red), weighted by the opening of its gates."""
    shown = axes.imshow(opened * push, origin="lower", extent=(0, 1, 0, 1), cmap="RdBu_r", vmin=-1, vmax=1)
    axes.contour(
        opened, [0.25, 0.5, 0.75], extent=(0, 1, 0, 1), colors="0.3", linewidths=(0.6, 1.2, 0.6), linestyles="-"
    )
    axes.set(xticks=(), yticks=())
    for spine in axes.spines.values():
        spine.set_visible(True)
    return shown


def _draw_curves(axes: Axes, values: Values, words: Mapping[str, str]) -> None:
    counts = dict(zip(words, values["parameters"], strict=True))
    for name, (colour, line) in CURVES.items():
        label = f"{words[name]} ({counts[name]} parameters)"
        thousands = values["decision"] / 1e3
        style = {"records": SMOOTH, "linestyle": line}
        draw_band(axes, thousands, values[f"{name} reward"], colour, label, **style)
    axes.set(xlabel="thousand decisions", ylabel="reward per decision")
    axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5), fontsize=8)
