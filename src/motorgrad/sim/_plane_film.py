"""Films of learning in the plane of a particle."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING

import numpy as np

from motorgrad._errors import check
from motorgrad.sim._film import Film, target_of
from motorgrad.sim._plane_course import Course
from motorgrad.sim._plane_paths import trajectories

if TYPE_CHECKING:
    pass

MOST = 600.0  # seconds


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
    """Write a film of a learner that learns: its units move over the reward, and paths follow.

    To the left are reward, units and paths, as `draw_reward`, `draw_units` and `draw_paths` have them; to the right
    the reward of all learners, with a mark that runs along it, and the number of units where that changes. Moments are
    taken evenly; where there are fewer than frames, each stays for several. The last one stays for a second more.

    **Arguments:**

    - `course`: what happened.
    - `path`: ends in ".mp4" (1280 × 720) or ".gif" (800 × 450); missing folders are made, an older film is replaced.
    - `fps`: frames a second, above 0; a GIF rounds their length to hundredths of a second.
    - `seconds`: of film, up to 600.
    - `paths`: drawn at a time, with the same random numbers at every moment, so that what changes is the policy; a
      single one where there are no episodes.
    - `decisions`: the most in a path.
    - `seed`: of the paths.
    - `progress`: called with the frames done and their total after each.

    **Returns:** a `Film`.

    **Raises:** `ValueError` for input that is out of range or cannot be drawn, before any work.
    """
    from motorgrad.sim._plane_stage import Stage
    from motorgrad.sim._video import write_gif, write_mp4

    target = target_of(path, ".mp4", ".gif")
    check(math.isfinite(fps) and 0 < fps <= 100, "fps", fps, "a number above 0, up to 100")
    check(0 < seconds <= MOST, "seconds", seconds, f"above 0, up to {MOST:g} s")
    check(isinstance(paths, int) and 0 <= paths <= 1000, "paths", paths, "from 0 to 1000")
    moving = max(1, round(seconds * fps))
    moments = np.linspace(0, len(course.decision) - 1, moving).round().astype(int)
    moments = np.append(moments, np.full(round(fps), moments[-1]))
    episodes = paths if course.task.has_episodes else min(paths, 1)

    gif = target.suffix.lower() == ".gif"
    stage = Stage(course, 100 if gif else 160)

    def picture(moment: int) -> np.ndarray:
        policy = course.policy(moment)
        walked = trajectories(course.task, policy, episodes, seed, decisions) if episodes else []
        return stage.paint(moment, policy, walked)

    def pictures() -> Iterator[np.ndarray]:
        frame = 0
        for moment, count in zip(*np.unique(moments, return_counts=True), strict=True):
            painted = picture(int(moment))
            for _ in range(count):
                yield painted
                frame += 1
                if progress is not None:
                    progress(frame, len(moments))

    target.parent.mkdir(parents=True, exist_ok=True)
    if gif:
        write_gif(target, pictures(), fps, like=picture(int(moments[-1])))
    else:
        write_mp4(target, pictures(), (1280, 720), fps)
    return Film(target, "drawn", len(moments), len(moments) / fps)
