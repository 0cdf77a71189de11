"""Recorded motions as one HTML file, with a clock, cameras and plots that move along."""

# pyright: reportAttributeAccessIssue=false
# (MuJoCo's bindings carry no types)
from __future__ import annotations

import html
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from motorgrad._files import write_atomically
from timsim.film import MAX_PLOT_LINES, Annotations, Motion, Plot, muscle_colour, output_path
from timsim.film._motion import resample
from timsim.replay._annotated import annotated
from timsim.replay._packing import packed
from timsim.replay._recorded import recorded

if TYPE_CHECKING:
    import mujoco

MAX_REPLAY_BYTES = 10_000_000
MIN_FRAME_RATE = 5.0  # frames per second, below which a motion is no longer seen


@dataclass(frozen=True)
class Replay:
    """The result of `write_replay`: the file, its size in bytes, frames per second and in all, and seconds."""

    path: Path
    size: int
    fps: float
    frames: int
    seconds: float


def write_replay(
    motions: Motion | Sequence[Motion],
    path: str | os.PathLike[str],
    *,
    plots: Sequence[Plot] = (),
    annotations: Callable[[float], Annotations] | None = None,
    fps: float = 30,
    title: str = "",
) -> Replay:
    """Write motions as one HTML file of at most 10 MB that any browser plays, without a server or the network.

    It shows the bodies with their muscles, a clock, cameras, names, and plots of activations and joints. You can play,
    pause, scrub, change the speed, and turn the camera. The address keeps moment and view (`#t=1.2&camera=front`).

    **Arguments:**

    - `motions`: shown side by side, with the same cameras; the last posture of a shorter one stays until the end.
    - `path`: ends in ".html"; missing folders are created, an existing file is replaced.
    - `plots`: more plots, such as of the reward; activations and joint angles are always there.
    - `annotations`: texts, and arrows in the scene of the first motion, as a function of the time on that motion's
      clock; plots that change become plots of the whole time.
    - `fps`: recorded frames per second, at most 120; postures between them are interpolated. It is halved until the
      file is small enough.
    - `title`: of the page; by default the labels of the motions.

    **Returns:** a `Replay`.

    **Raises:** `ValueError` for input out of range, or where five frames per second are still more than 10 MB.

    Meshes have the mean colour of their texture; skins and flexible bodies are left out.

    ```py
    write_replay([before, after], "hop.html", plots=[Plot("reward", time, reward)])
    ```
    """
    check_arguments(write_replay, locals())
    motions = [motions] if isinstance(motions, Motion) else list(motions)
    check(motions, "motions", motions, "at least one Motion")
    for index, motion in enumerate(motions):
        check(isinstance(motion, Motion), f"motions[{index}]", motion, "a Motion")
    for index, plot in enumerate(plots):
        check(isinstance(plot, Plot), f"plots[{index}]", plot, "a Plot")
    check(np.isfinite(fps) and MIN_FRAME_RATE <= fps <= 120, "fps", fps, f"from {MIN_FRAME_RATE:g} to 120")
    target = output_path(path, ".html")
    title = title or ", ".join(motion.label for motion in motions if motion.label) or target.stem
    page = b""
    rate = float(fps)
    frames = 0
    seconds = max(motion.seconds for motion in motions)
    while True:
        frames = int(np.floor(seconds * rate + 1e-6)) + 1
        page = _page(motions, plots, annotations, np.arange(frames) / rate, title)
        if len(page) <= MAX_REPLAY_BYTES:
            break
        size = f"{len(page) / 1e6:.1f} MB at {rate:g} frames per second"
        check(
            rate / 2 >= MIN_FRAME_RATE, "replay", size, f"at most {MAX_REPLAY_BYTES / 1e6:g} MB: take a shorter motion"
        )
        rate /= 2
    target.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(target, page)
    return Replay(target, len(page), rate, frames, seconds)


def _page(
    motions: Sequence[Motion],
    plots: Sequence[Plot],
    annotations: Callable[[float], Annotations] | None,
    moments: np.ndarray,
    title: str,
) -> bytes:
    """The whole page, with the postures at these moments `(frames,)` in s after the start."""
    arrays: dict[str, np.ndarray] = {"moments": moments.astype(np.float32)}
    described = []
    for index, motion in enumerate(motions):
        about, columns = recorded(motion.model, *resample(motion, moments)[1:])
        described.append({**about, "label": motion.label})
        arrays |= {f"{index}.{name}": column for name, column in columns.items()}
    ladder = (255 * muscle_colour(np.array([0.0, 1.0, np.nan]))).round().astype(int).tolist()
    times = motions[0].time[0] + moments
    added, columns, curves = annotated(
        [] if annotations is None else [annotations(float(time)) for time in times], times
    )
    arrays |= columns
    drawn = [*plots, *curves, *(plot for motion in motions for plot in motion_plots(motion, len(motions) > 1))]
    about = {
        "title": title,
        "motions": described,
        "colours": ladder,
        "added": added,
        "plots": [_plotted(plot, f"plot{index}", motions[0].time[0], arrays) for index, plot in enumerate(drawn)],
    }
    files = (Path(__file__).with_name(name) for name in ("player.html", "player.css", "renderer.js", "player.js"))
    text, *parts = (file.read_text("utf-8") for file in files)
    for mark, part in zip(("STYLE", "RENDERER", "PLAYER"), parts, strict=True):
        text = text.replace(f"/*{mark}*/", part)
    text = text.replace("<!--TITLE-->", html.escape(title))
    return text.replace("<!--DATA-->", packed(about, arrays)).encode()


def _plotted(plot: Plot, name: str, begin: float, arrays: dict[str, np.ndarray]) -> dict[str, Any]:
    """A description of a plot, whose numbers are added to `arrays`."""
    spread = np.nan_to_num(np.nanstd(plot.values, axis=0)) if plot.values.size else np.zeros(len(plot.names))
    chosen = np.sort(np.argsort(-spread, kind="stable")[:MAX_PLOT_LINES])
    arrays[f"{name}.time"] = (plot.time - begin).astype(np.float32)
    arrays[f"{name}.values"] = plot.values[:, chosen].T.astype(np.float32)
    of = len(plot.names) if len(plot.names) > MAX_PLOT_LINES else 0
    return {"title": plot.title, "unit": plot.unit, "names": [plot.names[i] for i in chosen], "of": of}


def motion_plots(motion: Motion, labelled: bool) -> list[Plot]:
    """Activations, angles of hinges (°) and positions of slides and free bodies (m) of a motion."""
    model = motion.model
    suffix = f", {motion.label}" if labelled and motion.label else ""
    found = []
    if model.nu:
        names = [model.actuator(index).name or str(index) for index in range(model.nu)]
        found.append(Plot(f"activation{suffix}", motion.time, motion.activation, names))
    angles, places = _coordinates(model)
    for title, chosen, unit in (("joint angles", angles, "°"), ("positions", places, "m")):
        if chosen:
            columns = [column for column, _ in chosen]
            names = [name for _, name in chosen]
            values = motion.position[:, columns]
            values = np.degrees(values) if unit == "°" else values
            found.append(Plot(f"{title}{suffix}", motion.time, values, names, unit))
    return found


def _coordinates(model: mujoco.MjModel) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """The columns and names of the angles of hinges, and of the positions of slides and free joints."""
    import mujoco

    angles = []
    places = []
    for index in range(model.njnt):
        kind = model.jnt_type[index]
        first = int(model.jnt_qposadr[index])
        name = model.joint(index).name or model.body(model.jnt_bodyid[index]).name or str(index)
        if kind == mujoco.mjtJoint.mjJNT_HINGE:
            angles.append((first, name))
        elif kind == mujoco.mjtJoint.mjJNT_SLIDE:
            places.append((first, name))
        elif kind == mujoco.mjtJoint.mjJNT_FREE:
            places += [(first + axis, f"{name} {letter}") for axis, letter in enumerate("xyz")]
    return angles, places
