"""Reproduce an experiment: run it or load what is stored, draw the figure, judge the claims, and leave a record."""

import dataclasses
import json
import re
import time
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import filelock
import tomli_w

from motorgrad._errors import check, unknown
from motorgrad._files import read_arrays, read_toml, refuse_links, replacing, write_arrays, write_atomically
from motorgrad.options import finite_table
from motorgrad.schema import table
from motorgrad.training import RunWarning, provenance, provenance_changes
from motorgrad_thesis._claims import Claim, claim_source
from motorgrad_thesis._experiment import Experiment, Values, Workspace
from motorgrad_thesis._figures import STYLE
from motorgrad_thesis._records import SESSIONS, read_record
from timsim import animate

QUICK = 2.0  # seconds of film in a smoke test


@dataclasses.dataclass(frozen=True)
class Reproduction:
    """The outcome of reproducing an experiment.

    - `experiment`, with its settings; `folder`, which holds all files.
    - `claims`, with their verdicts.
    - `sessions`: one entry per session, as `motorgrad.training.provenance` returns it (versions, processor, command),
      with its `seconds` and, as `trained`, the seconds of training behind every run that was used, shared or not.
    - `quick`: whether this was a smoke test, whose claims mean nothing.
    """

    experiment: Experiment
    folder: Path
    claims: tuple[Claim, ...]
    sessions: tuple[dict[str, Any], ...]
    quick: bool

    @property
    def seconds(self) -> float:
        """Total duration of the sessions."""
        return sum(session["seconds"] for session in self.sessions)

    @property
    def trained(self) -> float:
        """Seconds of training behind all runs that were used, in these sessions or earlier."""
        return sum({name: took for session in self.sessions for name, took in session["trained"].items()}.values())

    @property
    def figure(self) -> Path:
        """The figure as SVG; a PNG of the same name lies beside it."""
        return self.folder / "figure.svg"

    @property
    def films(self) -> list[Path]:
        """The films of learning in the folder."""
        return sorted(self.folder.glob("animation*.mp4"))

    @property
    def command(self) -> str:
        """The command that runs the experiment again."""
        kind = type(self.experiment)
        usual = table(kind.quick() if self.quick else kind())
        settings = table(self.experiment)
        changed = [f" --settings.{key} {value}" for key, value in settings.items() if usual.get(key) != value]
        return "".join([f"motorgrad reproduce {kind.name}", " --quick" if self.quick else "", *changed])

    def record(self) -> dict[str, Any]:
        """Everything as a plain table, with infinities as `None`, which JSON requires."""
        about = self.experiment
        return {
            "name": about.name,
            "title": about.title,
            "part": about.part,
            "source": about.source,
            "reading": about.reading,
            "summary": about.summary,
            "settings": table(about),
            "quick": self.quick,
            "command": self.command,
            "claims": [finite_table(claim.record()) for claim in self.claims],
            "seconds": self.seconds,
            "trained": self.trained,
            "versions": _every([session["versions"] for session in self.sessions]),
            "processor": " and ".join(dict.fromkeys(session["processor"] for session in self.sessions)),
            "figure": str(self.figure),
            "films": [str(film) for film in self.films],
        }


def reproduce(
    experiment: Experiment,
    out: Path | str = "runs/reproduce",
    *,
    quick: bool = False,
    threads: int = 0,
    progress: bool = True,
    films: bool = False,
) -> Reproduction:
    """Run an experiment in `out/NAME`, reusing the finished parts that are stored there.

    **Arguments:** the experiment, with its settings; `out`, a folder; `quick`, whether to label it a smoke test;
    `threads` for physics, 0 for one per processor; `progress`, whether to show progress; `films`, whether to film the
    learning too, if the experiment has runs that can be filmed.

    **Raises:** `ValueError` if the folder holds the experiment with other settings; `KeyboardInterrupt` if Ctrl-C
    stopped it: calling it again resumes.
    """
    folder = Path(out) / experiment.name
    folder.mkdir(parents=True, exist_ok=True)
    refuse_links(folder, "parts")
    try:
        with filelock.FileLock(folder / ".lock", timeout=0):
            work = Workspace(folder, Path(out) / "trained", threads, progress)
            return _reproduce(experiment, folder, work, quick, films)
    except filelock.Timeout:
        raise RuntimeError(f"{folder} is in use by another process") from None


def _reproduce(experiment: Experiment, folder: Path, work: Workspace, quick: bool, films: bool) -> Reproduction:
    check_settings(experiment, folder)
    write_atomically(folder / "config.toml", tomli_w.dumps(table(experiment)).encode())
    stored = folder / "values.npz"
    about = folder / "provenance.json"
    sessions = read_record(about, SESSIONS)["sessions"] if about.exists() else []
    if sessions and (changes := list(provenance_changes(sessions[-1], provenance()))):
        warnings.warn(f"{folder}: continues what was made differently: {'; '.join(changes)}", RunWarning, stacklevel=4)
    if not stored.exists():
        write_arrays(stored, _session(experiment, work, about, sessions))
    # read back, so that a figure drawn now and one drawn later are identical
    values = read_arrays(stored)
    try:
        _draw(experiment, values, folder)
        made = experiment.claims(values)
        claims = tuple(dataclasses.replace(claim, source=claim_source(claim, experiment.source)) for claim in made)
    except KeyError as error:
        raise ValueError(f"{stored}: holds no {error}: made by another version; delete the folder {folder}") from None
    if films:
        _film(experiment, work, QUICK if quick else None)
    done = Reproduction(experiment, folder, claims, tuple(read_record(about, SESSIONS)["sessions"]), quick)
    write_atomically(folder / "record.json", json.dumps(done.record(), indent=2, allow_nan=False).encode())
    return done


def _session(experiment: Experiment, work: Workspace, about: Path, sessions: list[dict[str, Any]]) -> Values:
    """Run the experiment and record time, place, versions and duration, even if it is interrupted."""
    session = provenance()
    started = time.monotonic()
    try:
        return experiment.run(work)
    finally:
        session |= {"seconds": time.monotonic() - started, "trained": work.trained}
        write_atomically(about, json.dumps({"sessions": [*sessions, session]}, indent=2).encode())


def check_settings(experiment: Experiment, folder: Path) -> None:
    """**Raises** `ValueError` if the folder holds the experiment with other settings."""
    file = folder / "config.toml"
    settings = table(experiment)
    before = read_toml(file) if file.exists() else settings
    if before != settings:
        key = next(key for key in [*settings, *before] if before.get(key) != settings.get(key))
        raise ValueError(
            f"{folder} holds {experiment.name} with {key} = {before.get(key)!r}, not {settings.get(key)!r}: "
            "use another folder, or delete that one"
        )


def _draw(experiment: Experiment, values: Any, folder: Path) -> None:
    """Write the figure as SVG, with the same bytes for the same values, and as PNG."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        figure = experiment.figure(values)
        with replacing(folder / "figure.svg") as file:
            figure.savefig(file, format="svg", metadata={"Date": None})
        with replacing(folder / "figure.png") as file:
            figure.savefig(file, format="png", dpi=160)


def _film(experiment: Experiment, work: Workspace, seconds: float | None) -> None:
    """Make the films that are missing."""
    runs = experiment.films(work)
    if not runs:
        work.say("nothing to film")
    for name, run in runs.items():
        path = work.path / f"{name}.mp4"
        if not path.exists():
            animate(run, path, seconds=seconds, progress=work.progress)


def _every(versions: Sequence[dict[str, str]]) -> dict[str, str]:
    """Versions over all sessions, listing every version of a library that changed."""
    names = dict.fromkeys(name for each in versions for name in each)
    return {name: ", ".join(dict.fromkeys(each[name] for each in versions if name in each)) for name in names}


def select_experiments(names: Sequence[str], registry: dict[str, type[Experiment]]) -> list[str]:
    """Experiments that `names` select, in the registry's order: names, `"chapter-5"`, `"appendix-a"`, `"all"`.

    **Raises** `ValueError` for any other name, with the nearest match.
    """
    parts: dict[str, list[str]] = {"all": list(registry)}
    for name, kind in registry.items():
        parts.setdefault(kind.quick().part, []).append(name)
    wanted: set[str] = set()
    for given in names:
        name = given.lower()
        if re.fullmatch(r"(chapter|appendix)-\w", name) and name not in parts:
            check(False, "experiments", given, f"a part with experiments: {', '.join(sorted(set(parts) - {'all'}))}")
        if name not in registry and name not in parts:
            raise unknown("experiment", given, [*registry, *parts])
        wanted |= set(parts.get(name, [name]))
    return [name for name in registry if name in wanted]
