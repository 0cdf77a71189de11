"""Learning curves: several runs and quantities in one figure."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, get_args

from motorgrad._errors import check, choice
from motorgrad.training.plots._plot_curves import Axis, Plotted, axis_for, check_smooth, curve_of
from motorgrad.training.plots._plot_labels import labels_of

if TYPE_CHECKING:
    from motorgrad.training.plots._plot_figure import LearningCurves

Format = Literal["svg", "png", "pdf"]
FORMATS = get_args(Format)


def learning_curves(
    runs: Sequence[Plotted],
    quantity: str | Sequence[str] = "reward",
    path: Path | str | None = None,
    *,
    x: Axis | None = None,
    smooth: float | None = None,
    labels: Sequence[str] | None = None,
    format: Format | None = None,
) -> "LearningCurves":
    """Compare runs: every run a colour, the median over its seeds a line, the quartiles a band.

    Single seeds are thin lines where there are at most three runs of at most 64 seeds. Where a quantity did not occur,
    the line has a gap; median and quartiles are over the seeds in which it did. The legend says how many policies are
    not finite, and so have no values.

    **Arguments:**

    - `runs`: what `train` or `load` gave.
    - `quantity`: a column of their metrics, or several: a panel each, above one x axis.
    - `path`: where to save the figure, if anywhere: `.svg` (its text stays text), `.png` (300 dots per inch) or `.pdf`;
      or a folder, in which it is named after the quantities. The same numbers give the same bytes.
    - `x`: `"decisions"`; `"simulated"`, `"wall"` or `"cpu"` seconds. By default simulated seconds where all runs are of
      one task that knows them, else decisions.
    - `smooth`: each point is the mean over the last `smooth` units of x, of all that occurred there: the mean of a
      record longer than the run's own. By default no more than the records' own means. The figure states it.
    - `labels`: what to call the runs. By default the settings in which they differ, or else their folders.
    - `format`: `"svg"`, `"png"` or `"pdf"`, where the path has no suffix that says it; then it is added to the path.

    **Returns** a matplotlib `Figure`, which shows itself in a notebook. Its `curves` hold the numbers drawn (`label`,
    `quantity`, `x`, `values (seeds, records)`, `quartiles (3, records)`), its `axis` says what x is, and `saved` where
    the file is.

    **Raises** `ValueError` for what cannot be drawn, before anything is.
    """
    quantities = [quantity] if isinstance(quantity, str) else list(quantity)
    check(len(runs) > 0, "runs", runs, "at least one run")
    different = quantities and len(set(quantities)) == len(quantities)
    check(different, "quantity", quantity, "one column or more, none of them twice")
    if smooth is not None:
        number = isinstance(smooth, int | float) and 0 < smooth < math.inf
        check(number, "smooth", smooth, "a positive number, in the units of the x axis")
    file = None if path is None else figure_file(Path(path), quantities, format)
    if labels is None:
        labels = labels_of([run.config for run in runs], [run.path for run in runs])
    known = not isinstance(labels, str) and len(labels) == len(runs) == len(set(labels)) and all(labels)
    check(known, "labels", labels, f"{len(runs)} different words, one for each run")
    for run, label in zip(runs, labels, strict=True):
        _check_quantities(run, quantities, label if len(runs) > 1 else None)
    axis = axis_for(runs, x)
    panels = [
        [curve_of(run, name, axis, smooth, label) for run, label in zip(runs, labels, strict=True)]
        for name in quantities
    ]
    check_smooth(smooth, axis, panels[0])

    from motorgrad.training.plots._plot_figure import draw, save

    figure = draw(panels, axis, smooth)
    if file is not None:
        save(figure, *file)
    return figure


def _check_quantities(run: Plotted, quantities: Sequence[str], label: str | None) -> None:
    """Refuse a run without the quantities; among several runs, say which."""
    try:
        for name in quantities:
            run.curve(name)
    except ValueError as error:
        raise error if label is None else ValueError(f"{label}: {error}") from None


def figure_file(path: Path, quantities: Sequence[str], format: Format | None) -> tuple[Path, str]:
    """The file of a figure and its format, which is that of the suffix unless `format` says it."""
    if path.is_dir():
        name = "-".join(quantities).replace("/", "-").replace("\\", "-")  # columns of a stranger's run have any names
        path /= f"{name}.{format or 'png'}"
    suffix = path.suffix.lower().removeprefix(".")
    kind = format or suffix or "png"
    choice("format", kind, FORMATS)
    check(suffix == kind or suffix not in FORMATS, "format", format, f"{suffix!r}, as the suffix of {path} says")
    return (path if suffix == kind else path.with_name(f"{path.name}.{kind}")), kind
