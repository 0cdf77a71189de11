"""Reproducing: run an experiment or take up what is there, draw it, judge its claims, and leave a record."""

import dataclasses
import json
import math
import time
import tomllib
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import filelock
import tomli_w

from motorgrad._arrays import read_arrays, write_arrays
from motorgrad._errors import unknown
from motorgrad._files import read_json, write_atomically
from motorgrad._settings import table
from motorgrad.experiments._animate import animate
from motorgrad.experiments._claim import Claim
from motorgrad.experiments._experiment import Experiment, Values
from motorgrad.experiments._style import STYLE
from motorgrad.experiments._workspace import Workspace
from motorgrad.training import RunWarning, provenance, provenance_changes

QUICK = 2.0  # seconds of film at a smoke size


@dataclasses.dataclass(frozen=True)
class Reproduction:
    """What reproducing an experiment left.

    - `experiment`, with its settings; `folder`, where everything is.
    - `claims`: each judged.
    - `sessions`: of the run, as `motorgrad.training.provenance` has them: versions, processor, command; `seconds`; and,
      as `trained`, of every training run that was used, shared ones too, the seconds that it took.
    - `quick`: whether this was a smoke size, whose claims mean nothing.
    """

    experiment: Experiment
    folder: Path
    claims: tuple[Claim, ...]
    sessions: tuple[dict[str, Any], ...]
    quick: bool

    @property
    def seconds(self) -> float:
        """That the sessions took together."""
        return sum(session["seconds"] for session in self.sessions)

    @property
    def trained(self) -> float:
        """Seconds of training in the runs that were used, in these sessions or in others."""
        return sum({name: took for session in self.sessions for name, took in session["trained"].items()}.values())

    @property
    def figure(self) -> Path:
        """The figure; beside it lies the same as PNG."""
        return self.folder / "figure.svg"

    @property
    def films(self) -> list[Path]:
        """The films of learning that lie there."""
        return sorted(self.folder.glob("animation*.mp4"))

    @property
    def command(self) -> str:
        """What does it again."""
        kind = type(self.experiment)
        usual, settings = table(kind.quick() if self.quick else kind()), table(self.experiment)
        changed = [f" --settings.{key} {value}" for key, value in settings.items() if usual.get(key) != value]
        return "".join([f"motorgrad reproduce {kind.name}", " --quick" if self.quick else "", *changed])

    def record(self) -> dict[str, Any]:
        """Everything as a plain table, without infinities, which JSON does not know."""
        about = self.experiment
        return {
            "name": about.name,
            "title": about.title,
            "source": about.source,
            "summary": about.summary,
            "settings": table(about),
            "quick": self.quick,
            "command": self.command,
            "claims": [_plain(dataclasses.asdict(claim)) for claim in self.claims],
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
    """Run an experiment in `out/NAME`; finished parts that lie there are not done again.

    **Arguments:** the experiment, with its settings; `out`, a folder; `quick`, whether to call it a smoke size;
    `threads` for physics, 0 for one per processor; `progress`, whether to show it; `films`, whether to film the
    learning too, where the experiment says what of.

    **Raises:** `ValueError` if the folder holds the experiment with other settings; `KeyboardInterrupt` where it was
    stopped by Ctrl-C: the same call goes on.
    """
    folder = Path(out) / experiment.name
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with filelock.FileLock(folder / ".lock", timeout=0):
            work = Workspace(folder, Path(out) / "trained", threads, progress)
            return _reproduce(experiment, folder, work, quick, films)
    except filelock.Timeout:
        raise RuntimeError(f"{folder} is in use by another process") from None


def _reproduce(experiment: Experiment, folder: Path, work: Workspace, quick: bool, films: bool) -> Reproduction:
    _settle(experiment, folder)
    stored, about = folder / "values.npz", folder / "provenance.json"
    sessions = read_json(about)["sessions"] if about.exists() else []
    if sessions and (changes := list(provenance_changes(sessions[-1], provenance()))):
        warnings.warn(f"{folder}: goes on with what was made otherwise: {'; '.join(changes)}", RunWarning, stacklevel=4)
    if not stored.exists():
        write_arrays(stored, _session(experiment, work, about, sessions))
    # read back, so that a figure made now and one made later show the same
    values = read_arrays(stored)
    try:
        _draw(experiment, values, folder)
        claims = tuple(experiment.claims(values))
    except KeyError as error:
        raise ValueError(f"{stored}: holds no {error}: made by another version; delete the folder {folder}") from None
    if films:
        _film(experiment, work, QUICK if quick else None)
    done = Reproduction(experiment, folder, claims, tuple(read_json(about)["sessions"]), quick)
    write_atomically(folder / "record.json", json.dumps(done.record(), indent=2, allow_nan=False).encode())
    return done


def _session(experiment: Experiment, work: Workspace, about: Path, sessions: list[dict[str, Any]]) -> Values:
    """Run the experiment, and note when, where, by which versions and for how long, also where it is stopped."""
    session, started = provenance(), time.monotonic()
    try:
        return experiment.run(work)
    finally:
        session |= {"seconds": time.monotonic() - started, "trained": work.trained}
        write_atomically(about, json.dumps({"sessions": [*sessions, session]}, indent=2).encode())


def _settle(experiment: Experiment, folder: Path) -> None:
    """Make the folder that of these settings, or refuse it."""
    file, settings = folder / "config.toml", table(experiment)
    if file.exists():
        before = tomllib.loads(file.read_text())
        if before != settings:
            keys = [*settings, *before]
            key = next(key for key in keys if before.get(key) != settings.get(key))
            raise ValueError(
                f"{folder} holds {experiment.name} with {key} = {before.get(key)!r}, not {settings.get(key)!r}: "
                "give another folder, or delete that one"
            )
    write_atomically(file, tomli_w.dumps(settings).encode())


def _draw(experiment: Experiment, values: Any, folder: Path) -> None:
    """The figure as SVG, the same bytes for the same values, and as PNG."""
    import matplotlib

    with matplotlib.rc_context(STYLE):
        figure = experiment.figure(values)
        figure.savefig(folder / "figure.svg", metadata={"Date": None})
        figure.savefig(folder / "figure.png", dpi=160)


def _film(experiment: Experiment, work: Workspace, seconds: float | None) -> None:
    """The films that are not there yet."""
    runs = experiment.films(work)
    if not runs:
        work.say("nothing of it can be filmed")
    for name, run in runs.items():
        path = work.path / f"{name}.mp4"
        if not path.exists():
            animate(run, path, seconds=seconds, progress=work.progress)


def _every(versions: Sequence[dict[str, str]]) -> dict[str, str]:
    """The versions of all sessions: of a library that changed, each."""
    names = dict.fromkeys(name for each in versions for name in each)
    return {name: ", ".join(dict.fromkeys(each[name] for each in versions if name in each)) for name in names}


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value


def chosen(names: Sequence[str], registry: dict[str, type[Experiment]]) -> list[str]:
    """The experiments that `names` mean, in the registry's order: names, `"chapter-5"`, `"appendix-a"`, `"all"`.

    **Raises** `ValueError` for a name that is none of these, with the nearest.
    """
    parts: dict[str, list[str]] = {"all": list(registry)}
    for name, kind in registry.items():
        parts.setdefault(kind.quick().part, []).append(name)
    wanted: set[str] = set()
    for given in names:
        name = given.lower()
        if name not in registry and name not in parts:
            raise unknown("experiment", given, [*registry, *parts])
        wanted |= set(parts.get(name, [name]))
    return [name for name in registry if name in wanted]
