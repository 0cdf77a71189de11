"""The picture of a film of learning: what stays is drawn once, what moves anew in every frame."""

# The artists of matplotlib that move are drawn over a stored picture of the rest, which is some ten times as quick.
from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, UInt8

from motorgrad.sim._plane import INK, draw_paths, draw_reward, draw_units

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from motorgrad.policies import Policy
    from motorgrad.sim._plane_course import Course

SIZE = (8.0, 4.5)  # inches
MANY = 1_000_000  # decisions: numbers from here on would be too long for the axis
BLUE, FAINT = "#0072B2", "0.45"
LOOK: dict[Any, Any] = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False}
SAID = "outline: width of a unit;  arrow: the force it switches on;  dash: one decision"


class Stage:
    """A canvas on which one moment of a course after another is painted."""

    def __init__(self, course: Course, dpi: int) -> None:
        import matplotlib
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure

        with matplotlib.rc_context(LOOK):
            self._figure = Figure(figsize=SIZE, dpi=dpi)
            self._canvas = FigureCanvasAgg(self._figure)
            self._course = course
            plane = self._figure.add_axes((0.02, 0.1, 0.82 * SIZE[1] / SIZE[0], 0.82))
            draw_reward(plane, course.task)
            policy = course.policy(0)
            self._paths = draw_paths(plane, [])
            self._units = draw_units(plane, policy, course.task.dynamics.forces)
            self._clock = self._figure.text(0.02 + 0.82 * SIZE[1] / SIZE[0], 0.945, "", ha="right", fontsize=10)
            said = f"{course.task.name}, {course.label}" if course.label else course.task.name
            self._figure.text(0.02, 0.945, said, fontsize=10, fontweight="bold")
            self._figure.text(0.02, 0.04, SAID, fontsize=7, color=FAINT)
            self._curves = self._panels()
            self._moving = [*self._paths.artists, *self._units.artists, self._clock]
            self._moving += [artist for curve in self._curves for artist in curve.artists]
            for artist in self._moving:
                artist.set_animated(True)
            self._canvas.draw()
        self._still = self._canvas.copy_from_bbox(self._figure.bbox)

    def _panels(self) -> list[Running]:
        """The curves to the right: the reward, and the units where they change in number."""
        course = self._course
        count = len(course.reward)
        many = f"median and quartiles of {count} seeds"
        low, height = (0.12, 0.8) if course.units is None else (0.44, 0.48)
        panel = self._figure.add_axes((0.59, low, 0.365, height))
        panel.set_ylabel("mean reward per decision")
        curves = [Running(panel, course.decision, course.reward, course.shown, many)]
        if course.units is not None:
            below = self._figure.add_axes((0.59, 0.12, 0.365, 0.24), sharex=panel)
            below.set_ylabel("units")
            curves.append(Running(below, course.decision, course.units, course.shown, "", step=True))
            panel.tick_params(labelbottom=False)
            added = np.flatnonzero(np.diff(course.units[course.shown]) > 0) + 1
            for decision in course.decision[added]:
                panel.axvline(decision, color="0.85", linewidth=0.6, zorder=0)
            panel = below
        panel.set_xlabel("decisions" if course.decision[-1] < MANY else "million decisions")
        return curves

    def paint(self, moment: int, policy: Policy, paths: Sequence[Any]) -> UInt8[np.ndarray, "height width 3"]:
        """The picture of a moment, as a new array."""
        self._paths.update(paths)
        self._units.update(policy)
        self._clock.set_text(f"decision {self._course.decision[moment]:,}")
        for curve in self._curves:
            curve.update(moment)
        self._canvas.restore_region(self._still)
        for artist in self._moving:
            (artist.axes or self._figure).draw_artist(artist)
        return np.asarray(self._canvas.buffer_rgba())[..., :3].copy()


class Running:
    """A curve of every learner, of which one is shown up to the present moment."""

    def __init__(
        self,
        axes: Axes,
        decision: np.ndarray,
        values: Float[np.ndarray, "learners moments"],
        shown: int,
        label: str,
        step: bool = False,
    ) -> None:
        from matplotlib.ticker import FuncFormatter, MaxNLocator

        self._x, self._y = decision, values[shown]
        style: Any = {"drawstyle": "steps-post"} if step else {}
        seen = np.isfinite(values).any(axis=0)
        if len(values) > 1:
            low, median, high = np.nanpercentile(values[:, seen], [25, 50, 75], axis=0)
            fill: Any = {"step": "post"} if step else {}
            axes.fill_between(decision[seen], low, high, color=BLUE, alpha=0.18, linewidth=0, **fill)
            axes.plot(decision[seen], median, color=BLUE, linewidth=1.3, label=label or None, **style)
        axes.plot(decision, self._y, color=INK, linewidth=0.5, alpha=0.3, **style)
        axes.set_xlim(0, max(int(decision[-1]), 1))
        axes.xaxis.set_major_locator(MaxNLocator(4, integer=True))
        few = decision[-1] < MANY
        axes.xaxis.set_major_formatter(FuncFormatter(lambda at, _: f"{at:,.0f}" if few else f"{at / MANY:g}"))
        axes.yaxis.set_major_locator(MaxNLocator(5, integer=step))
        if step:
            axes.set_ylim(0, None)
        (self._line,) = axes.plot([], [], color=INK, linewidth=0.8, label="seed shown", **style)
        (self._dot,) = axes.plot([], [], "o", color=INK, markersize=5, clip_on=False, zorder=5)
        self._now = axes.axvline(0, color=FAINT, linewidth=0.8)
        if label:
            beside: Any = {"ncols": 2, "handlelength": 1.4, "columnspacing": 1.2, "borderaxespad": 0.4, "fontsize": 7.5}
            axes.legend(loc="lower right", bbox_to_anchor=(1.02, 1.0), **beside)
        self.artists = (self._now, self._line, self._dot)

    def update(self, moment: int) -> None:
        """Show the curve up to a moment."""
        x, y = self._x[: moment + 1], self._y[: moment + 1]
        self._line.set_data(x, y)
        self._dot.set_data(x[-1:], y[-1:])
        self._now.set_xdata([x[-1], x[-1]])
