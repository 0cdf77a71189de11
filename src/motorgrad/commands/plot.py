"""`motorgrad plot RUN…`: learning curves, and films of learning."""

import dataclasses
from pathlib import Path
from typing import Any, Literal

from motorgrad._applications import PICTURES, film_maker, offered
from motorgrad._errors import check, plain
from motorgrad._files import check_writable
from motorgrad.options import json_help, parse, write_json
from motorgrad.schema import Settings, count, number, static
from motorgrad.training import check_tensorboard, folders_of, learning_curves, load, write_tensorboard
from motorgrad.training.plots import figure_file


@dataclasses.dataclass(frozen=True)
class Plot(Settings):
    """Draw the learning curves of one run, or of several in one figure: medians, and quartiles over the seeds."""

    runs: tuple[Path, ...] = static(positional="RUN ...", help="Run directories")
    quantity: tuple[str, ...] = static(
        ("reward",), help="Columns of the metrics, such as reward, baseline or (hopper) apex; a panel for each"
    )
    x: Literal["decisions", "simulated", "wall", "cpu"] | None = static(
        None,
        help="The horizontal axis: decisions, or seconds of simulated, wall or processor (cpu) time; by "
        "default simulated seconds where the task has them",
    )
    smooth: float | None = number(
        None, help="Each point is the mean over this many units of x before it; by default over one record"
    )
    labels: tuple[str, ...] | None = static(
        None, help="Names of the runs; by default the settings in which they differ, or their folders"
    )
    out: Path | None = static(
        None,
        help="The file of the figure (.png, .svg, .pdf); by default figures/QUANTITY.png in the directory of "
        "the first run",
    )
    format: Literal["svg", "png", "pdf"] | None = static(None, help="The figure's format, where --out has no suffix")
    tensorboard: tuple[Path, ...] | None = static(
        None,
        metavar="[DIR]",
        help="Also write TensorBoard event files to this folder, by default to tensorboard/ of each run",
    )
    animate: tuple[Path, ...] | None = static(
        None,
        metavar="[FILE]",
        help="Also film the learning of a run of a particle task: to this file (.mp4, .gif), by default "
        "figures/learning.mp4 of the run",
    )
    seed: int | None = count(
        None, help="The seed to film; by default the one in the middle, by its reward in the last quarter"
    )
    seconds: float = number(12.0, 0, 600, open_low=True, unit="s", help="The length of the film")
    json: Path | None = static(None, help=json_help("the path of the figure and the numbers drawn"))

    def validate(self) -> None:
        check(self.runs, "runs", self.runs, "one run directory at least")
        if self.tensorboard is not None:
            check(len(self.tensorboard) <= 1, "tensorboard", self.tensorboard, "one folder, or none")
            check_tensorboard()
        if self.animate is not None:
            check(len(self.animate) <= 1, "animate", self.animate, "one file, or none")
            check(len(self.runs) == 1, "runs", [str(path) for path in self.runs], "a single one, to be filmed")
            for file in self.animate:
                check(file.suffix.lower() in (".mp4", ".gif"), "animate", str(file), "a file ending in .mp4 or .gif")
                check_writable("animate", file)
                if file.suffix.lower() == ".mp4":
                    film_maker("film")
        alone = self.seed is not None and self.animate is None
        check(not alone, "seed", self.seed, "given with --animate: the curves are of all seeds")

    @property
    def figure(self) -> Path:
        """The file of the figure."""
        return figure_file(self.out or self.runs[0] / "figures", self.quantity, self.format)[0]


def run(arguments: list[str]) -> int:
    options = parse(Plot, arguments, "plot")
    runs = [load(path) for path in options.runs]
    if options.animate is not None:
        offered("course of a run", *PICTURES)(runs[0], options.seed)  # raises at once for a run that cannot be filmed
    out = options.out or options.runs[0] / "figures"
    figure = learning_curves(
        runs, options.quantity, out, x=options.x, smooth=options.smooth, labels=options.labels, format=options.format
    )
    found: dict[str, Any] = {
        "figure": str(figure.saved),
        "runs": [str(path) for path in options.runs],
        "x": figure.axis,
        "smooth": options.smooth,
        "curves": [curve.table() for curve in figure.curves],
    }
    said = [f"drawn to {figure.saved}"]
    if options.tensorboard is not None:
        folders = _folders(options.runs, *options.tensorboard)
        found["tensorboard"] = [str(write_tensorboard(run, folder)) for run, folder in zip(runs, folders, strict=True)]
        said += [f"event files in {folder}" for folder in folders]
    if options.animate is not None:
        animate = offered("film of learning", *PICTURES)
        film = animate(runs[0], *options.animate, seed=options.seed, seconds=options.seconds)
        found["film"] = {"path": str(film.path), "frames": film.frames, "seconds": film.seconds}
        said.append(f"filmed to {film.path}")
    if str(options.json) != "-":
        print("\n".join(map(plain, said)))
    write_json(options.json, found)
    return 0


def _folders(runs: tuple[Path, ...], together: Path | None = None) -> list[Path]:
    """The folder for the event files of each run: its own in a shared folder, or in the run directory."""
    if together is None:
        return [run / "tensorboard" for run in runs]
    return [together / name for name in folders_of(runs)]
