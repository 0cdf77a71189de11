"""Films of learning in the plane of a particle."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float, Int

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad._labels import literal
from motorgrad.plane import INK, draw_paths, draw_reward, draw_units, shapes_of, trajectories
from timsim.film import Film, output_path, write_gif, write_mp4
from timsim.plane._picture import Animation, Pixels

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from motorgrad.policies import Policy
    from motorgrad.tasks import ParticleTask


@dataclass(frozen=True, eq=False)
class Course:
    """The course of learning on a particle task: the rewards of several learners, and the policy of one, at some
    moments.

    **Arguments:**

    - `task`: on a particle.
    - `decision`: the number of each moment, increasing.
    - `policies`: of the learner shown, with the moments along a leading axis.
    - `reward`: mean per decision up to each moment, of every learner; NaN where there is none yet.
    - `shown`: the row of the learner shown.
    - `units`: the number of units of each learner, where it changes; otherwise None.
    - `label`: the name of the learner shown.

    **Raises:** `ValueError` for arrays that do not fit together, and for units without a centre in the plane.
    """

    task: ParticleTask
    decision: Int[np.ndarray, " moments"]
    policies: Policy
    reward: Float[np.ndarray, "learners moments"]
    shown: int = 0
    units: Float[np.ndarray, "learners moments"] | None = None
    label: str = ""

    def __post_init__(self) -> None:
        check_arguments(Course, vars(self))
        count = len(self.decision)
        shape = self.reward.shape
        check(
            count > 0 and bool(np.all(np.diff(self.decision) > 0)),
            "decision",
            self.decision,
            "increasing, at least one",
        )
        check(shape[0] > 0 and shape[1:] == (count,), "reward", shape, f"of shape (learners, {count})")
        if self.units is not None:
            check(self.units.shape == shape, "units", self.units.shape, f"the reward's, {shape}")
        check(0 <= self.shown < shape[0], "shown", self.shown, f"a row of the reward, from 0 to {shape[0] - 1}")
        shapes_of(self.policy(0))  # refuses units without a centre in the plane

    def policy(self, moment: int) -> Policy:
        """The policy at one moment."""
        import jax

        return jax.tree.map(lambda leaf: np.asarray(leaf[moment]), self.policies)


MAX_FILM_SECONDS = 600.0


def film_learning(
    course: Course,
    path: str | os.PathLike[str],
    *,
    fps: float = 25,
    seconds: float = 12.0,
    paths: int = 8,
    decisions: int = 120,
    seed: int = 0,
    progress: Callable[[int, int], object] | None = None,
) -> Film:
    """Write a film of a learner: its units move over the reward while its trajectories change.

    On the left are reward, units and trajectories, as `draw_reward`, `draw_units` and `draw_paths` draw them. On the
    right is the reward of all learners, with a mark at the present moment, and the number of units where that changes.
    Moments are spread evenly over the film; where there are fewer moments than frames, each is shown for several. The
    last one stays for one more second.

    **Arguments:**

    - `course`: what to show.
    - `path`: ends in ".mp4" (1280 × 720) or ".gif" (800 × 450); missing folders are created, an existing file is
      replaced.
    - `fps`: frames per second, above 0, up to 100; a GIF rounds the length of a frame to hundredths of a second.
    - `seconds`: length of the film, up to 600.
    - `paths`: trajectories shown at a time; they use the same random numbers at every moment, so that only the policy
      changes. Without episodes, at most one.
    - `decisions`: maximum length of a trajectory.
    - `seed`: of the trajectories.
    - `progress`: called after each frame with the number of frames done and their total.

    **Returns:** a `Film`.

    **Raises:** `ValueError` for input that is out of range or cannot be drawn, before any work.

    ```py
    film_learning(Course(task, decision, policies, reward), "learning.mp4", seconds=8)
    ```
    """
    check_arguments(film_learning, locals())
    target = output_path(path, ".mp4", ".gif")
    check(math.isfinite(fps) and 0 < fps <= 100, "fps", fps, "a number above 0, up to 100")
    check(0 < seconds <= MAX_FILM_SECONDS, "seconds", seconds, f"above 0, up to {MAX_FILM_SECONDS:g} s")
    check(isinstance(paths, int) and 0 <= paths <= 1000, "paths", paths, "from 0 to 1000")
    moving = max(1, round(seconds * fps))
    moments = np.linspace(0, len(course.decision) - 1, moving).round().astype(int)
    moments = np.append(moments, np.full(round(fps), moments[-1]))
    episodes = paths if course.task.has_episodes else min(paths, 1)

    gif = target.suffix.lower() == ".gif"
    canvas = LearningPicture(course, 100 if gif else 160)

    def picture(moment: int) -> np.ndarray:
        policy = course.policy(moment)
        walks = trajectories(course.task, policy, episodes, seed, decisions) if episodes else []
        return canvas.paint(moment, policy, walks)

    def pictures() -> Iterator[np.ndarray]:
        frame = 0
        for moment, count in zip(*np.unique(moments, return_counts=True), strict=True):
            shown = picture(int(moment))
            for _ in range(count):
                yield shown
                frame += 1
                if progress is not None:
                    progress(frame, len(moments))

    target.parent.mkdir(parents=True, exist_ok=True)
    if gif:
        write_gif(target, pictures(), fps, like=picture(int(moments[-1])))
    else:
        write_mp4(target, pictures(), (1280, 720), fps)
    return Film(target, "drawn", len(moments), len(moments) / fps)


SIZE = (8.0, 4.5)  # inches
MANY = 1_000_000  # decisions; larger numbers are written in millions
BLUE = "#0072B2"
FAINT = "0.45"
STYLE: dict[Any, Any] = {"font.size": 9, "axes.spines.top": False, "axes.spines.right": False, "legend.frameon": False}
LEGEND = "outline: width of a unit;  arrow: its force;  dash: one decision"


class LearningPicture:
    """The picture of a film of learning, moment by moment."""

    def __init__(self, course: Course, dpi: int) -> None:
        import matplotlib
        from matplotlib.figure import Figure

        with matplotlib.rc_context(STYLE):
            self._figure = Figure(figsize=SIZE, dpi=dpi)
            self._course = course
            plane = self._figure.add_axes((0.02, 0.1, 0.82 * SIZE[1] / SIZE[0], 0.82))
            draw_reward(plane, course.task)
            policy = course.policy(0)
            self._paths = draw_paths(plane, [])
            self._units = draw_units(plane, policy, course.task.dynamics.forces)
            self._clock = self._figure.text(0.02 + 0.82 * SIZE[1] / SIZE[0], 0.945, "", ha="right", fontsize=10)
            title = f"{course.task.name}, {course.label}" if course.label else course.task.name
            self._figure.text(0.02, 0.945, literal(title), fontsize=10, fontweight="bold")
            self._figure.text(0.02, 0.04, LEGEND, fontsize=7, color=FAINT)
            self._curves = self._add_curves()
            curves = [artist for curve in self._curves for artist in curve.artists]
            moving = [*self._paths.artists, *self._units.artists, self._clock, *curves]
            self._animation = Animation(self._figure, moving)

    def _add_curves(self) -> list[ProgressCurve]:
        """The curves on the right: the reward, and the number of units where it changes."""
        course = self._course
        count = len(course.reward)
        label = "one seed" if count == 1 else f"median and quartiles of {count} seeds"
        low, height = (0.12, 0.8) if course.units is None else (0.44, 0.48)
        panel = self._figure.add_axes((0.59, low, 0.365, height))
        panel.set_ylabel("mean reward per decision")
        curves = [ProgressCurve(panel, course.decision, course.reward, course.shown, label)]
        if course.units is not None:
            below = self._figure.add_axes((0.59, 0.12, 0.365, 0.24), sharex=panel)
            below.set_ylabel("units")
            curves.append(ProgressCurve(below, course.decision, course.units, course.shown, "", step=True))
            panel.tick_params(labelbottom=False)
            added = np.flatnonzero(np.diff(course.units[course.shown]) > 0) + 1
            for decision in course.decision[added]:
                panel.axvline(decision, color="0.85", linewidth=0.6, zorder=0)
            panel = below
        panel.set_xlabel("decisions" if course.decision[-1] < MANY else "million decisions")
        return curves

    def paint(self, moment: int, policy: Policy, paths: Sequence[Any]) -> Pixels:
        """The picture of a moment, as a new array."""
        self._paths.update(paths)
        self._units.update(policy)
        self._clock.set_text(f"decision {self._course.decision[moment]:,}")
        for curve in self._curves:
            curve.update(moment)
        return self._animation.draw()


class ProgressCurve:
    """The curves of all learners as a band, and the curve of one up to the current moment."""

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

        self._x = decision
        self._y = values[shown]
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
        x = self._x[: moment + 1]
        y = self._y[: moment + 1]
        self._line.set_data(x, y)
        self._dot.set_data(x[-1:], y[-1:])
        self._now.set_xdata([x[-1], x[-1]])
