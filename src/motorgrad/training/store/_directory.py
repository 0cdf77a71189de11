"""The run directory, which survives a kill at any instant.

    config.toml          the effective configuration
    .signature           its user's signature of the table `task`, which may name code
    provenance.json      versions, processor and command of every session
    metrics/*.parquet    records, one file for the time between two checkpoints
    metrics/SHA256SUMS   their checksums
    checkpoint/*         the last two complete states, and the initial policies
    figures/             figures and films

The newest whole checkpoint is the commit point: on resume, later metrics are discarded and recomputed. It covers every
file: it holds the configuration, and checksums of the initial policies, of the sessions and of the list of metrics.
"""

import contextlib
import errno
import json
import os
import re
import uuid
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import filelock
import numpy as np
import pyarrow as pa
import tomli_w
from jaxtyping import PyTree

from motorgrad._errors import shown
from motorgrad._files import read_content, read_json, read_toml, refuse_links, remove_partials, write_atomically
from motorgrad._limits import MAX_JSON_BYTES, MAX_SETTINGS_BYTES, MAX_SIGNATURE_BYTES
from motorgrad._ownership import is_signed, signature
from motorgrad._reading import content_of, json_in
from motorgrad.training.store._checkpoint import CorruptCheckpoint, checksum, is_whole, load, save
from motorgrad.training.store._facts import check_config, facts_of, learner_of
from motorgrad.training.store._metrics import Damage, MetricsFiles
from motorgrad.training.store._provenance import provenance, provenance_changes, versions
from motorgrad.training.store._warning import warn_of_reading

AGAIN = "training makes them again from the checkpoint before them"
LOST = "no checkpoint before them is kept, so they are left out, unless you delete the folder checkpoint to begin again"
ON_PURPOSE = "put it back, or use it on purpose with allow_changed=True (train and evaluate: --allow-changed)"


SIGNATURE = ".signature"
CHECKPOINT = re.compile(r"[0-9]{12}\.state")
Commit = tuple[dict[str, np.ndarray], dict[str, Any]]
"""A checkpoint: its arrays by path, and the facts about them."""


class RunDirectoryError(RuntimeError):
    """A run directory that cannot be used: locked by another process, of another configuration, or not a run at all."""


class RunDirectory:
    """The directory of a run. As a context manager, it is locked against other processes."""

    def __init__(self, path: Path | str):
        self.path = Path(path)
        self._lock = filelock.FileLock(self.path / ".lock", timeout=0)
        self._holder = f"{os.getpid()} {uuid.uuid4().hex}"
        self._metrics = MetricsFiles(self.path / "metrics")
        self._committed: dict[str, Any] | None = None
        self._torn = False
        self._bound: dict[str, Any] = {}

    def __enter__(self) -> Self:
        if self.path.exists() and not self.path.is_dir():
            raise RunDirectoryError(f"{self.path} is a file, not a run directory")
        if self.path.is_dir() and not self.is_run:
            # a run killed before it wrote anything leaves empty folders and hidden files
            files = (p for p in self.path.rglob("*") if p.is_file() and not p.name.startswith("."))
            if (found := next(files, None)) is not None:
                raise RunDirectoryError(f"{self.path} holds other files ({found.name}) and no config.toml: not a run")
        self.path.mkdir(parents=True, exist_ok=True)
        self._refuse_links()
        try:
            self._lock.acquire()
        except filelock.Timeout:
            holder = self.path / ".holder"
            content = read_content(holder, MAX_SIGNATURE_BYTES) if holder.exists() else b""
            process = content.decode(errors="replace").split()[:1]
            who = f" (process {shown(process[0])[1:-1]})" if process else ""
            raise RunDirectoryError(f"{self.path} is in use by another process{who}") from None
        try:
            write_atomically(self.path / ".holder", self._holder.encode())
            for folder in (self.path, self.path / "metrics", self.path / "checkpoint"):
                remove_partials(folder)
        except BaseException:  # on a full disk; who tries again in this process must not wait for it
            self._lock.release()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        with contextlib.suppress(OSError):  # the folder may be gone, or another's
            if self.is_held:
                (self.path / ".holder").unlink(missing_ok=True)
        self._lock.release()

    @property
    def is_held(self) -> bool:
        """Whether the folder at the path is still the one that was locked. **Raises** `OSError` where none is."""
        return read_content(self.path / ".holder", MAX_SIGNATURE_BYTES) == self._holder.encode()

    @property
    def is_run(self) -> bool:
        """Whether the directory has a configuration, or a checkpoint, which holds one."""
        return (self.path / "config.toml").is_file() or bool(self._checkpoints())

    def read_config(self) -> dict[str, Any]:
        """The configuration. **Raises** `RunDirectoryError` where there is none, and for a link in the directory."""
        if not (self.path / "config.toml").is_file():
            raise RunDirectoryError(f"{self.path} is not a run directory: it has no config.toml")
        self._refuse_links()
        try:
            config = read_toml(self.path / "config.toml")
            check_config(config)
        except ValueError as error:
            raise RunDirectoryError(f"{self.path} is not a run directory: its config.toml: {error}") from None
        return config

    def config(self, about: dict[str, Any] | None, allow_changed: bool = False) -> dict[str, Any]:
        """The configuration, compared with that of a checkpoint, which is returned, with a warning (`RunWarning`),
        where `config.toml` is damaged. **Raises** `RunDirectoryError` that names the first setting that differs, unless
        `allow_changed`. More or fewer steps are only a warning."""
        try:
            config = self.read_config()
        except RunDirectoryError as error:
            if about is None:
                raise
            warn_of_reading(f"{error}; using the configuration in the newest checkpoint")
            return about["config"]
        if about is None:
            return config
        file = self.path / "config.toml"
        for where, now, then in differences(config, about["config"]):
            said = f"{file}: {where} is {now!r}, and was {then!r} when the newest checkpoint was saved"
            if where != "run.steps" and not allow_changed:
                raise RunDirectoryError(f"{said}: {ON_PURPOSE}")
            warn_of_reading(said)
        if tomli_w.dumps(config).encode() != content_of(file, MAX_SETTINGS_BYTES):
            warn_of_reading(f"{file}: was altered since motorgrad wrote it, but no setting was")
        return config

    def write_config(self, config: dict[str, Any]) -> None:
        """Write the configuration, which makes the folder a run directory. Call it before any other write."""
        write_atomically(self.path / "config.toml", tomli_w.dumps(config).encode())
        write_atomically(self.path / SIGNATURE, signature(_as_bytes(config["task"])).encode())
        for name in ("metrics", "checkpoint", "figures"):
            (self.path / name).mkdir(exist_ok=True)

    def is_ours(self, task: Mapping[str, Any]) -> bool:
        """Whether this user wrote a configuration with this table `task` here; what it names is then no stranger's."""
        try:
            mark = content_of(self.path / SIGNATURE, MAX_SIGNATURE_BYTES).decode("ascii", "replace")
        except (OSError, ValueError):
            return False
        return is_signed(_as_bytes(task), mark)

    def add_session(self, seeds: list[int], about: dict[str, Any] | None, continues: bool) -> None:
        """Add this process to the run's provenance. Warn of changes where it `continues` the run of a checkpoint."""
        file = self.path / "provenance.json"
        if wrong := [] if about is None else self._wrong_provenance(about):
            warn_of_reading(f"{wrong[0]}; set aside as {file.name}.damaged, and begun again")
            if file.exists():
                os.replace(file, file.with_name(f"{file.name}.damaged"))
        sessions = _sessions(file, read_json(file)) if file.exists() else []
        sessions.append(provenance())
        changes = list(provenance_changes(*sessions[-2:])) if continues and len(sessions) > 1 else []
        if changes:
            warn_of_reading(f"{self.path} continues, but not bit for bit: {'; '.join(changes)}")
        write_atomically(file, json.dumps({"seeds": seeds, "sessions": sessions}, indent=2).encode())
        self._bound = {
            "provenance": {"sessions": len(sessions), "checksum": _sessions_checksum(seeds, sessions)},
            "initial": load(self._initial)[1]["checksum"],
            "versions": versions(),
        }

    def save(
        self, state: PyTree[np.ndarray], about: dict[str, Any], records: pa.Table | None, short: pa.Table | None = None
    ) -> None:
        """Commit the records since the last checkpoint, then the state, and delete the oldest state.

        **Arguments:** `about`: the decision, the last one `recorded`, the configuration …; `short`, a record of an
        unfinished window, which goes where the run continues. **Raises** `OSError` where something cannot be written.
        The last commit then stands, and a later call is to bring all records again.
        """
        if not self.is_held:
            raise OSError(errno.ESTALE, "another folder is in its place", str(self.path))
        if self._torn:
            self.roll_back(self._committed)
        self._torn = True
        if records is not None:
            self._metrics.append(*self._metrics.write(records))
        more = None if short is None else self._metrics.write(short)
        about = {**about, **self._bound, "metrics": self._metrics.mark, "short": more}
        save(self._checkpoint(about["decision"]), state, about)
        self._committed = about
        self._torn = False
        with contextlib.suppress(OSError):  # the next commit tries again
            for old in self._checkpoints()[:-2]:
                old.unlink()

    @property
    def has_initial_policies(self) -> bool:
        """Whether the policies before learning are stored."""
        return self._initial.is_file()

    def save_initial(self, policies: PyTree[np.ndarray], learner: dict[str, Any]) -> None:
        """Store the policies before learning, and the learner as a table."""
        save(self._initial, policies, {"decision": 0, "learner": learner})

    def initial(self) -> dict[str, np.ndarray]:
        """The policies before learning, by the names of their fields."""
        return load(self._initial)[0]

    def learner(self) -> dict[str, Any] | None:
        """The learner as a table, with the structure of its policy; `None` before the first decision."""
        return learner_of(self._initial, load(self._initial)[1]) if self._initial.exists() else None

    def latest(self) -> Commit | None:
        """The newest whole checkpoint, `None` before the first. For a damaged checkpoint it warns (`RunWarning`) and
        uses the one before. **Raises** `RunDirectoryError` if all are damaged, so that nothing is discarded
        silently."""
        if self.is_run:
            self._refuse_links()
        for before, path in reversed(list(enumerate(self._checkpoints()))):
            try:
                return facts_of(path, *load(path))
            except FileNotFoundError:  # its process has saved newer ones since
                return self.latest()
            except CorruptCheckpoint as error:
                if not before:
                    raise RunDirectoryError(
                        f"{error}; there is none before it. Delete the folder {path.parent} to train from the start"
                    ) from None
                warn_of_reading(f"{error}; using the checkpoint before it")
        return None

    def to_continue(self) -> Commit | None:
        """The checkpoint from which training continues: the newest whole one, or the one before it if that one's
        records are damaged and can so be made again. It warns (`RunWarning`) of all damage."""
        found = self.latest()
        damage = [] if found is None else self._read(found[1])[1]
        if found is None or not damage:
            return found
        before = self._before(found[1])
        for each in damage:
            warn_of_reading(self._said(each, before))
        return before if before is not None and any(each.decision > before[1]["recorded"] for each in damage) else found

    def has_its_end(self, about: dict[str, Any]) -> bool:
        """Whether nothing is to be made again at a checkpoint at the end of a run."""
        return not self._read_short(about)[1] and not self._wrong_provenance(about)

    def roll_back(self, about: dict[str, Any] | None, finished: bool = False) -> None:
        """Return to a checkpoint: discard later ones and metrics that it does not cover, which will be recomputed.
        Unless the run is `finished`, the record of its unfinished window goes, too."""
        decision, recorded = (0, 0) if about is None else (about["decision"], about["recorded"])
        known = {} if about is None else self._metrics.listed(about["metrics"], recorded)[0]
        for path in self._checkpoints():
            if int(path.stem) > decision:
                path.unlink()
            elif int(path.stem) < decision and not is_whole(path):
                warn_of_reading(f"{path}: the checksum does not match; removed, as the newer checkpoint is whole")
                path.unlink()
        about = None if about is None else {**about, "short": about["short"] if finished else None}
        self._metrics.roll_back(recorded, known, about["short"][0] if about and about["short"] else None)
        self._committed = about

    def metrics(self, about: dict[str, Any] | None = None) -> pa.Table | None:
        """All records that a checkpoint covers, in order; by default, the last one that was saved here. It warns
        (`RunWarning`) of damaged files, and leaves them out."""
        about = self._committed if about is None else about
        if about is None:
            return None
        (tables, damage) = self._read(about)
        (last, more) = self._read_short(about)
        tables += last
        before = self._before(about) if damage else None
        for each in damage:
            warn_of_reading(self._said(each, before))
        for each in more:
            warn_of_reading(f"{self._metrics.folder / each.name} {each.what}; training makes it again")
        try:
            return pa.concat_tables(tables, promote_options="default") if tables else None
        except pa.ArrowException as error:  # of files of different columns
            raise RunDirectoryError(f"{self._metrics.folder}: the records do not fit together: {error}") from None

    def check_rest(self, about: dict[str, Any]) -> None:
        """Warn of a damaged `provenance.json` or older checkpoint; refuse initial policies of another run."""
        for wrong in self._wrong_provenance(about):
            warn_of_reading(wrong)
        for path in self._checkpoints():
            if int(path.stem) < about["decision"] and not is_whole(path):
                warn_of_reading(f"{path}: the checksum does not match; the newer checkpoint is whole")
        if self.has_initial_policies and load(self._initial)[1]["checksum"] != about["initial"]:
            raise RunDirectoryError(f"{self._initial}: is not that of this run")

    def _read(self, about: dict[str, Any]) -> tuple[list[pa.Table], list[Damage]]:
        files, damage = self._metrics.listed(about["metrics"], about["recorded"])
        tables, more = self._metrics.read(files)
        return tables, damage + more

    def _read_short(self, about: dict[str, Any]) -> tuple[list[pa.Table], list[Damage]]:
        """The record of the unfinished window at the end of a run, which follows from the state."""
        return self._metrics.read({} if about["short"] is None else dict([about["short"]]))

    def _said(self, damage: Damage, before: Commit | None) -> str:
        """What is wrong with a file, and what becomes of its records if there is a commit `before`."""
        said = f"{self._metrics.folder / damage.name} {damage.what}"
        if not damage.decision:
            return said
        then = AGAIN if before is not None and damage.decision > before[1]["recorded"] else LOST
        return f"{said}; it has records up to decision {damage.decision:,}: {then}"

    def _before(self, about: dict[str, Any]) -> Commit | None:
        """The whole checkpoint before another one."""
        earlier = [path for path in self._checkpoints() if int(path.stem) < about["decision"] and is_whole(path)]
        return facts_of(earlier[-1], *load(earlier[-1])) if earlier else None

    def _wrong_provenance(self, about: dict[str, Any]) -> list[str]:
        file = self.path / "provenance.json"
        known = about["provenance"]
        try:
            found = json_in(content_of(file, MAX_JSON_BYTES))
            mark = _sessions_checksum(found["seeds"], _sessions(file, found)[: known["sessions"]])
        except (OSError, ValueError, KeyError, TypeError) as error:
            return [f"{file}: damaged: {type(error).__name__}: {error}"]
        return [] if mark == known["checksum"] else [f"{file}: damaged: its checksum does not match"]

    def _refuse_links(self) -> None:
        """Whoever made the directory could have all that is written into it go elsewhere."""
        try:
            refuse_links(self.path, "metrics", "checkpoint", "figures", "tensorboard")
        except ValueError as error:
            raise RunDirectoryError(str(error)) from None

    @property
    def _initial(self) -> Path:
        return self.path / "checkpoint" / "initial.policies"

    def _checkpoint(self, decision: int) -> Path:
        return self.path / "checkpoint" / f"{decision:012d}.state"

    def _checkpoints(self) -> list[Path]:
        found = (self.path / "checkpoint").glob("*.state")
        return sorted(path for path in found if CHECKPOINT.fullmatch(path.name))


def differences(now: object, then: object, where: str = "") -> Iterator[tuple[str, Any, Any]]:
    """The settings in which two configurations differ: the path of each, and both values."""
    if isinstance(now, dict) and isinstance(then, dict):
        for key in [*now, *(key for key in then if key not in now)]:
            yield from differences(now.get(key), then.get(key), f"{where}.{key}" if where else key)
    elif now != then and (now == now or then == then):  # NaN is the same as NaN
        yield where, now, then


def _as_bytes(task: Mapping[str, Any]) -> bytes:
    return json.dumps(task, sort_keys=True).encode()


def _sessions(file: Path, found: object) -> list[dict[str, Any]]:
    """The sessions in a file of provenance. **Raises** `ValueError` where one is none."""
    sessions = found.get("sessions") if isinstance(found, dict) else None
    right = isinstance(sessions, list) and all(
        isinstance(each, dict)
        and "processor" in each
        and isinstance(each.get("versions"), dict)
        and isinstance(each.get("compiler", {}), dict)
        for each in sessions
    )
    if not isinstance(sessions, list) or not right:
        raise ValueError(f"{file}: holds no list of sessions; delete it, or put it back")
    return sessions


def _sessions_checksum(seeds: list[int], sessions: list[Any]) -> str:
    return checksum(json.dumps([seeds, sessions], sort_keys=True).encode())
