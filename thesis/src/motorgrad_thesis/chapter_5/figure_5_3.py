"""Figure 5.3: the hopper's behaviour before and after learning."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from motorgrad._files import replacing
from motorgrad.statistics import mean_of, median_of
from motorgrad.training import Evaluation, Run
from motorgrad_thesis._claims import Claim, above, at_least, at_most, positive
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import EXTENSOR, FLEXOR, STYLE, Figure, subplots
from motorgrad_thesis.chapter_5._hopper_study import (
    HIGH,
    HopperStudy,
    hop_heights,
    median_seed,
    practice_heights,
)

INDEPENDENT = "an independent model of the hopper with the same numbers"
COLOURS = {"flexor": FLEXOR, "extensor": EXTENSOR}
TITLES = ("before learning", "after learning")


@experiment("fig-5.3", "the hopper's behaviour before and after learning", "figure 5.3")
class HopperBehaviour(HopperStudy):
    """The behaviour of a hopper before and after learning. From top to bottom: knee angle, foot height, and muscle
    activity. At first, muscles fire at random; later, the extensors push while the foot is on the ground, and the
    hopper flies. The median seed is shown."""

    def run(self, work: Workspace) -> Values:
        run = self.trained(work)
        before, after = (self.watch(work, run, untrained) for untrained in (True, False))
        _, heights, passed = practice_heights(run)
        return {
            **behaviour_of(run, before, after, median_seed(run, after)),
            "before": hop_heights(before),
            "after": hop_heights(after),
            "passed": passed,
            "final": heights[:, -1],
        }

    def figure(self, values: Values) -> Figure:
        return draw_behaviour(values)

    def claims(self, values: Values) -> Iterator[Claim]:
        before = values["before"]
        after = values["after"]
        heights = f"Medians: {median_of(before).value:.2f} m before, {median_of(after).value:.2f} m after learning."
        same = "Learning sooner or hopping higher counts as holding."
        yield positive("The hopper hops higher after learning.", mean_of(after - before), unit="m", note=heights)
        yield above(
            10,
            "The reward of a good jump exceeds 10, far above the penalty of 0.1 for a muscle.",
            mean_of(100 * after),
            note="The greatest height of a hop in m, times 100.",
            source="section 5.2",
        )
        yield at_most(
            450,
            f"The mean height of hops passes {HIGH} m after some 315 s of practice.",
            median_of(values["passed"]),
            "median; 315 s in that model, its seeds from 270 to 450:",
            "s",
            note=f"{same} A seed that never does counts with the whole practice.",
            kind="reference model",
            source=INDEPENDENT,
        )
        yield at_least(
            0.64,
            "After 1,500 s of practice, hops are some 0.72 m high.",
            median_of(values["final"]),
            "median; 0.72 ± 0.08 in that model:",
            "m",
            note=same,
            kind="reference model",
            source=INDEPENDENT,
        )


def behaviour_of(
    run: Run, before: Evaluation, after: Evaluation, seed: int, seconds: float = 4.0
) -> dict[str, np.ndarray]:
    """The data of `draw_behaviour` for one seed: the last `seconds` of both evaluations, `before` leading.

    **Returns** by name: `angle` (degrees) and `height` (m) of shape `(2, decisions)`, `firing` of shape `(2, decisions,
    groups)`, `groups`, `period` (s), `seed`.
    """
    row = run.seeds.index(seed)
    both = (before, after)
    part = before.time > before.time[-1] - seconds
    sensors = [outcome.sensors or {} for outcome in both]
    return {
        "angle": np.stack([90 + np.rad2deg(sensed["knee_angle"][row, part]) for sensed in sensors]),
        "height": np.stack([sensed["foot_height"][row, part] for sensed in sensors]),
        "firing": np.stack([outcome.control[row, part] > 0.5 for outcome in both if outcome.control is not None]),
        "groups": np.array(run.task.dynamics.groups),  # type: ignore[union-attr]
        "period": np.array(run.task.period),
        "seed": np.array(seed),
    }


def draw_behaviour(shown: dict[str, np.ndarray]) -> Figure:
    """Knee angle, foot height and muscle activity, before (left) and after (right)."""
    figure, axes = subplots(9, 5.4, 3, 2, sharex="col", sharey="row", height_ratios=[3, 3, 1.2])
    groups = shown["groups"].tolist()
    period = float(shown["period"])
    edges = period * np.arange(shown["angle"].shape[1] + 1)
    time = edges[:-1]
    for column, title in enumerate(TITLES):
        angle, height, muscles = axes[:, column]
        angle.plot(time, shown["angle"][column], color="0.25", linewidth=1)
        flight = shown["height"][column]
        height.fill_between(time, np.maximum(flight, 0), color="0.8", linewidth=0)
        height.plot(time, flight, color="0.25", linewidth=1)
        for line, group in enumerate(groups):
            level = np.where(shown["firing"][column, :, line], line + 0.8, line)
            muscles.stairs(level, edges, baseline=line, fill=True, color=COLOURS.get(group, f"C{line}"))
        muscles.set_yticks([line + 0.4 for line in range(len(groups))], groups)
        muscles.set_ylim(-0.2, len(groups))
        muscles.set_xlabel("time (s)")
        angle.set_title(title)
        angle.margins(x=0)
    axes[0, 0].set_ylabel("knee angle (°)")
    axes[1, 0].set_ylabel("foot height (m)")
    axes[2, 0].tick_params(left=False)
    figure.suptitle(f"Hopper, seed {int(shown['seed'])}", fontsize=10, color="0.4", x=0.99, ha="right")
    return figure


def behaviour_figure(
    run: Run, before: Evaluation, after: Evaluation, seed: int, path: Path | str | None = None, seconds: float = 4.0
) -> Figure:
    """`draw_behaviour` for one seed of a run, saved to `path` if given."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        figure = draw_behaviour(behaviour_of(run, before, after, seed, seconds))
        if path is not None:
            Path(path).parent.mkdir(parents=True, exist_ok=True)
            with replacing(Path(path)) as file:
                figure.savefig(file, format=Path(path).suffix.lstrip(".") or "png", dpi=160)
    return figure
