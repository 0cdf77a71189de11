"""Figure 2.2: hill climbing on the objective of a Gaussian policy."""

import itertools
from collections.abc import Iterator
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from motorgrad.schema import count
from motorgrad.statistics import exact, mean_of, median_of, share_of
from motorgrad_thesis._claims import Claim, above, below, positive
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, new_figure
from motorgrad_thesis.chapter_2._landscape import Bumps, climb, greatest, learn, surface

SIDE = 4.0  # actions are rewarded between −SIDE and SIDE
# initial standard deviations
WIDE = 3.0
NARROW = 0.3
BIASED = 3.0  # an initial mean off the centre
NEAR = 0.01  # the optimum counts as reached within this distance of the best reward
STEPS = 4000
RECORDS = 2000
RATE = 0.005
SHOWN = 4  # runs drawn for each kind of start, of those that learn from rewards alone
DRAWN = Bumps(
    np.array([0.55, 0.6, 0.45, 1.0, 0.5]), np.array([-3.2, -1.6, 0.0, 1.4, 3.0]), np.array([0.4, 0.45, 0.4, 0.45, 0.45])
)
SAMPLES = np.array(
    [(mean, 3.6) for mean in (-3.6, -1.2, 1.2, 3.6)]
    + [(mean, 0.6) for mean in (-3.7, -2.5, -0.75, -0.25, 0.6, 2.35, 3.7)]
)
"""Starts of the trajectories drawn: means and standard deviations."""

COLOURS = "viridis"
INK = "#1a1a1a"
NOISY = "#ff7043"


@experiment("fig-2.2", "hill climbing", "figure 2.2")
class HillClimbing(Experiment):
    """Policy search by hill climbing in one dimension: a policy that draws x from a Gaussian, a reward r(x) with
    several optima, and the objective as a surface over the mean and standard deviation of the Gaussian. The colour of a
    start is the optimum to which climbing leads from there, by exact gradients and from rewards alone. The reward drawn
    is our own example; claims about wide and narrow starts are also checked over random rewards.
    """

    columns: int = count(201, 5, 1000, help="number of columns of the grid of starts, along the Gaussian's mean")
    rows: int = count(101, 5, 1000, help="number of rows of the grid of starts, along its standard deviation")
    runs: int = count(200, 2, 10**5, help="number of learners from rewards alone, for each kind of start")
    decisions: int = count(50_000, RECORDS, 10**8, help="number of decisions of each of these learners")
    rewards: int = count(500, 2, 10**5, help="number of random rewards over which wide and narrow starts are compared")
    seed: int = count(0, help="seed of the learners and of the random rewards")

    quick = smoke(columns=13, rows=7, runs=4, decisions=RECORDS, rewards=4)

    def run(self, work: Workspace) -> Values:
        means = np.linspace(-SIDE, SIDE, self.columns)
        deviations = np.linspace(0, SIDE, self.rows)
        grid = np.stack(np.meshgrid(means, deviations), axis=-1).reshape(-1, 2)
        # a policy without noise cannot leave σ = 0: the edge of the surface takes the colour of what lies beside it
        starts = np.column_stack([grid[:, 0], np.maximum(grid[:, 1], 0.02)])
        found: Values = {
            "means": means,
            "deviations": deviations,
            "objective": _values(DRAWN, grid).reshape(self.rows, -1),
            "best": np.array(greatest(DRAWN, -SIDE, SIDE)),
        }
        found |= work.part("grid", lambda: {"ends": climb(DRAWN, starts, STEPS)[:, -1]})
        found["reached"] = _values(DRAWN, found["ends"]).reshape(self.rows, -1)
        found |= work.part("paths", lambda: {"paths": _paths()})
        for name in ("wide", "narrow"):
            found |= work.part(name, lambda n=name: self._learned(n))
        return found | work.part("random", self._random)

    def _learned(self, kind: str) -> Values:
        """Learning from rewards alone, from a wide start in the middle or from narrow starts everywhere: the end of
        each run, `(runs, 2)`, and the trajectories of some, `(SHOWN, 1 + records, 2)`."""
        wide = kind == "wide"
        means = np.zeros(self.runs) if wide else np.linspace(-SIDE, SIDE, self.runs)
        starts = np.column_stack([means, np.full(self.runs, WIDE if wide else NARROW)])
        points = learn(DRAWN, starts, self.decisions, RATE, RECORDS, 2 * self.seed + wide)
        some = np.linspace(0, self.runs - 1, SHOWN + 2).round().astype(int)[1:-1]
        shown = np.concatenate([starts[some, None], points[some]], axis=1)
        return {f"learned {kind}": points[:, -1], f"shown {kind}": shown}

    def _random(self) -> Values:
        """Whether climbing reaches the best optimum of random rewards, `(rewards, starts)`: from a wide start in the
        middle, from wide starts at either side, and from narrow starts everywhere."""
        numbers = np.random.default_rng(self.seed)
        starts = {
            "middle": [(0.0, WIDE)],
            "sides": [(-BIASED, WIDE), (BIASED, WIDE)],
            "narrow": [(mean, NARROW) for mean in np.linspace(-SIDE, SIDE, 17)],
        }
        begin = np.array([start for kind in starts.values() for start in kind])
        reached = []
        left = []
        for _ in range(self.rewards):
            height, centre, width = numbers.uniform([[0.2], [-SIDE], [0.3]], [[1.0], [SIDE], [0.6]], (3, 5))
            bumps = Bumps(height, centre, width)
            ends = climb(bumps, begin, STEPS)[:, -1]
            reached.append(_values(bumps, ends) > greatest(bumps, -SIDE - 1, SIDE + 1) - NEAR)
            left.append(np.abs(ends[:, 1]))
        bounds = np.cumsum([len(kind) for kind in starts.values()])[:-1]
        parts = np.split(np.array(reached), bounds, axis=1)
        return {f"random {name}": part for name, part in zip(starts, parts, strict=True)} | {
            "random left": np.array(left)
        }

    def figure(self, values: Values) -> Figure:
        """The objective as a surface, the same from above, and the reward beneath."""
        from matplotlib.cm import ScalarMappable
        from matplotlib.colors import Normalize

        figure = new_figure(13, 6.6, dpi=200)  # the surface is rasterised, also in an SVG
        grid = figure.add_gridspec(2, 2, width_ratios=[1.35, 1], height_ratios=[2.6, 1])
        reached = values["reached"]
        scale = Normalize(min(0.3, float(reached.min())), float(values["best"]))
        colour = ScalarMappable(scale, COLOURS)
        _surface(figure.add_subplot(grid[:, 0], projection="3d", computed_zorder=False), values, colour)
        above = figure.add_subplot(grid[0, 1])
        _above(above, values, colour)
        _reward(figure.add_subplot(grid[1, 1], sharex=above), values, colour)
        bar = figure.colorbar(colour, ax=figure.axes, location="bottom", fraction=0.035, pad=0.02, aspect=60)
        bar.set_label("reward of the optimum to which hill climbing leads")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        yield from _wide_claims(values)
        yield from _random_claims(values)
        yield from _noise_claims(values)


def _paths() -> np.ndarray:
    """The trajectories drawn, `(samples, 1 + records, 2)`."""
    return np.concatenate([SAMPLES[:, None], climb(DRAWN, SAMPLES, STEPS, RECORDS)], axis=1)


def _values(bumps: Bumps, points: Float[np.ndarray, "points 2"]) -> np.ndarray:
    return np.asarray(surface(bumps, jnp.asarray(points, float)), float)


WIDE_START = "A wide start reaches the best optimum more often than a narrow one."


def _wide_claims(values: Values) -> Iterator[Claim]:
    best = values["best"] - NEAR
    wide, narrow = (
        (values["reached"][np.abs(values["deviations"] - deviation).argmin()] > best).mean()
        for deviation in (WIDE, NARROW)
    )
    learned = {name: share_of(_values(DRAWN, values[f"learned {name}"]) > best) for name in ("wide", "narrow")}
    yield above(
        narrow,
        f"Hill climbing reaches the best optimum from more initial means if starts are wide (σ = {WIDE:g}) than if "
        f"they are narrow (σ = {NARROW:g}).",
        exact(wide),
        unit="of initial means",
        of=WIDE_START,
        note="For the reward drawn, by exact gradients.",
    )
    yield above(
        learned["narrow"].high,
        "Learning from rewards alone reaches it more often from a wide, unbiased start than from narrow ones.",
        learned["wide"],
        unit="of runs",
        of=WIDE_START,
        note=f"From narrow starts: {learned['narrow']}. For the reward drawn.",
    )


def _random_claims(values: Values) -> Iterator[Claim]:
    middle, sides, narrow = (values[f"random {name}"].mean(axis=1) for name in ("middle", "sides", "narrow"))
    for statement, of, other, words in (
        (
            "Over random rewards, a wide start in the middle reaches the best optimum more often than narrow starts",
            WIDE_START,
            narrow,
            "narrow",
        ),
        (
            "A wide start is better in the middle of the rewarded interval (unbiased) than at one side",
            "",
            sides,
            "biased",
        ),
    ):
        yield positive(
            f"{statement}.",
            mean_of(middle - other),
            unit="difference of the shares of starts",
            note=f"{middle.mean():.3g} against {other.mean():.3g} from {words} starts; sums of five bumps of random "
            "position, height and width, by exact gradients.",
            of=of,
        )


DETERMINISTIC = "Hill climbing converges to a deterministic policy."


def _noise_claims(values: Values) -> Iterator[Claim]:
    left = float(np.abs(values["ends"][:, 1]).max())
    yield below(
        1e-3,
        "Hill climbing converges to a deterministic policy, σ = 0, from every start.",
        exact(left),
        unit="is the greatest remaining σ",
        of=DETERMINISTIC,
        note="By exact gradients, for the reward drawn.",
    )
    yield below(
        0.05,
        "So does learning from rewards alone.",
        median_of(np.concatenate([values[f"learned {name}"][:, 1] for name in ("wide", "narrow")])),
        unit="is the remaining σ",
        of=DETERMINISTIC,
        note="It falls like the inverse square root of time, because the step size is proportional to σ².",
    )


def _surface(axes: Any, values: Values, colour: Any) -> None:
    from matplotlib.colors import LightSource

    mean, deviation = np.meshgrid(values["means"], values["deviations"])
    light = LightSource(azdeg=-60, altdeg=50)
    face = light.shade_rgb(
        colour.to_rgba(values["reached"])[..., :3], values["objective"], blend_mode="soft", vert_exag=4
    )
    style = {"rcount": 101, "ccount": 201, "shade": False, "linewidth": 0, "antialiased": False}
    drawn = axes.plot_surface(mean, deviation, values["objective"], facecolors=face, **style)
    drawn.set_rasterized(True)
    # the front edge is the reward itself
    axes.plot(values["means"], 0 * values["means"], values["objective"][0], color=INK, linewidth=1.4)
    for path in values["paths"]:
        line = _thinned(path)
        height = _height(values, line) + 0.012
        axes.plot(line[:, 0], line[:, 1], height, color="white", linewidth=2.6)
        axes.plot(line[:, 0], line[:, 1], height, color=INK, linewidth=1.3)
        axes.plot(*line[0], height[0], "o", color=INK, markersize=4, markeredgecolor="white")
    axes.set(
        xlabel=r"mean $\theta_\mu$", ylabel=r"standard deviation $\theta_\sigma$", zlabel=r"objective $\rho(\theta)$"
    )
    axes.view_init(elev=40, azim=-72)
    axes.set_box_aspect((1.5, 1.3, 0.8), zoom=1.18)
    axes.set_title("the objective, and hill climbing on it", loc="left")


def _thinned(path: np.ndarray) -> np.ndarray:
    """A trajectory without points closer than 0.01 to the last one kept; its end is kept."""
    kept = [0]
    for at in range(1, len(path)):
        if np.abs(path[at] - path[kept[-1]]).max() > 0.01:
            kept.append(at)
    return path[[*kept, len(path) - 1]]


def _height(values: Values, points: np.ndarray) -> np.ndarray:
    """The height of the drawn surface at these points."""
    from scipy.interpolate import RegularGridInterpolator

    deviation = values["deviations"]
    mean = values["means"]
    surface = RegularGridInterpolator((deviation, mean), values["objective"])
    inside = np.clip(points[:, ::-1], (0, mean[0]), (deviation[-1], mean[-1]))
    return surface(inside)


def _above(axes: Axes, values: Values, colour: Any) -> None:
    mean = values["means"]
    deviation = values["deviations"]
    axes.pcolormesh(mean, deviation, values["reached"], norm=colour.norm, cmap=COLOURS, rasterized=True)
    axes.contour(mean, deviation, values["objective"], levels=18, colors="white", linewidths=0.5, alpha=0.6)
    for path in (*values["shown wide"], *values["shown narrow"]):
        line = _thinned(path)
        axes.plot(line[:, 0], line[:, 1], color="white", linewidth=1.6, alpha=0.7)
        axes.plot(line[:, 0], line[:, 1], color=NOISY, linewidth=0.9)
        axes.plot(*path[0], "o", color=NOISY, markersize=4, markeredgecolor="white", clip_on=False)
    for path in values["paths"]:
        axes.plot(*_thinned(path).T, color=INK, linewidth=1.2)
        axes.plot(*path[0], "o", color=INK, markersize=4, markeredgecolor="white")
    axes.plot([], [], color=INK, label="exact gradient")
    axes.plot([], [], color=NOISY, label="from rewards alone")
    axes.set(ylabel=r"standard deviation $\theta_\sigma$", xlim=(mean[0], mean[-1]), ylim=(0, deviation[-1]))
    axes.tick_params(labelbottom=False)
    axes.set_title("from above", loc="left")
    axes.legend(loc="lower right", bbox_to_anchor=(1.01, 0.99), ncols=2, fontsize=9)


def _reward(axes: Axes, values: Values, colour: Any) -> None:
    mean = values["means"]
    reward = values["objective"][0]
    reached = values["reached"][1]
    ends = [0, *(np.flatnonzero(np.abs(np.diff(reached)) > 0.01) + 1), len(mean) - 1]
    for left, right in itertools.pairwise(ends):
        part = slice(left, right + 1)
        axes.fill_between(mean[part], reward[part], color=colour.to_rgba(reached[left]), linewidth=0)
    axes.plot(mean, reward, color=INK, linewidth=1.4)
    axes.set(xlabel=r"mean $\theta_\mu$, or action $x$", ylabel="reward $r(x)$", ylim=(0, None))
