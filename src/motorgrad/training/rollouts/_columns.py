"""Recorded decisions as the columns of a table."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from motorgrad.tasks import Task
from motorgrad.training.engines import raw_names, state_names
from motorgrad.training.rollouts._recording import Recording
from motorgrad.training.rollouts._rows import Rows
from motorgrad.training.rollouts._value import Values

Columns = dict[str, tuple[np.ndarray, str]]
"""Numbers `(rows,)` and unit by name."""
_Named = Iterator[tuple[str, np.ndarray, str]]


def columns_of(recording: Recording, lane: int, ended: np.ndarray, seed: int, values: Values | None) -> Columns:
    """All columns of a lane whose episodes `ended` there; the `seed` is that of its policy."""
    return _Lane(recording, lane, ended).columns(seed, values)


class _Lane:
    """The decisions of one lane, by the names of `transition`."""

    def __init__(self, recording: Recording, lane: int, ended: np.ndarray):
        self.recording = recording
        self.lane = lane
        self.count = len(ended)
        self.task: Task = recording.stepper.task
        self.rows = Rows(ended, recording.readings)
        self._parts = {name: part[: self.count, lane] for name, part in recording.parts.items()}
        self._parts.setdefault("diverged", np.zeros(self.count, bool))
        self.diverged = self._parts["diverged"]

    def columns(self, seed: int, values: Values | None) -> Columns:
        """All of them; a further one of a name has its number, too."""
        found: Columns = {"seed": (np.full(self.rows.count, seed), "1")}
        for name, numbers, unit in self._all(values):
            alike = sum(other == name or other.startswith(f"{name} (") for other in found) if name in found else 0
            found[f"{name} ({alike + 1})" if alike else name] = numbers, unit
        return found

    def _all(self, values: Values | None) -> _Named:
        task, rows, parts = self.task, self.rows, self._parts
        step = task.period / self.recording.readings
        for name, numbers in rows.moments(task.period, step).items():
            yield name, numbers, "s" if name == "time" else "1"
        seen = rows.starting(parts["input"], parts["end input"])
        if names := raw_names(task):
            raw = rows.starting(parts["observation"], parts["end observation"])
            yield from _family("observation", names, raw, task.observation_units)
            yield from _family("input", task.observation_names, seen, "1")
        else:
            yield from _family("observation", task.observation_names, seen, task.input_units)
        yield from self._actions()
        yield "reward", rows.led(self._earned(parts["reward"])), ""
        terms, metrics = (rows.led(self._earned(parts[name])) for name in ("terms", "metrics"))
        yield from _family("reward", task.reward_names, terms, _in_order(task.reward_units, task.reward_names))
        for name in ("terminated", "truncated", "diverged"):
            yield name, rows.led(parts[name]), "1"
        if values is not None:
            yield "value", self._values(values), ""
        yield from _family("metric", task.metric_names, metrics, _in_order(task.metric_units, task.metric_names))
        marks = rows.starting(parts["marks"], parts["end marks"])
        axes = [f"{k + 1} {axis}" for k in range(marks.shape[1] // 3) for axis in "xyz"]
        yield from _family("mark", axes, marks, "m")
        if "state" in parts:
            yield from _family("state", state_names(task), rows.starting(parts["state"], parts["end state"]))
        yield from self._read()

    def _actions(self) -> _Named:
        action = self._parts["action"].astype(float)
        unit = "" if self.task.actions == "continuous" else "1"
        if action.ndim == 1:
            yield "action", self.rows.starting(action), unit
            return
        own = self.task.action_names
        size = action.shape[1]
        names = own if len(own) == size else [str(k + 1) for k in range(size)]
        yield from _family("action", names, self.rows.starting(action), unit)

    def _earned(self, values: np.ndarray) -> np.ndarray:
        """Values without those of decisions in which the simulation diverged: they are unknown, and counted nowhere."""
        lost = self.diverged.reshape(-1, *[1] * (values.ndim - 1))
        return np.where(lost, np.nan, values)

    def _values(self, values: Values) -> np.ndarray:
        parts, rows = self._parts, self.rows
        name = "seen" if "seen" in parts else "input"
        action = parts["action"]
        before = np.roll(action, 1, axis=0)
        before[rows.within == 0] = -1 if action.ndim == 1 else 0
        starts = values.of(self.lane, parts[name], before)
        ends = values.of(self.lane, parts[f"end {name}"], action)
        ends = np.where(parts["terminated"], 0.0, ends) if values.of_future else np.full_like(ends, np.nan)
        return rows.starting(starts, np.where(self.diverged, np.nan, ends))

    def _read(self) -> _Named:
        """What was read of dynamics on the host."""
        recording, rows = self.recording, self.rows
        if recording.probe is None:
            return
        ends = np.stack([recording.ends[k][self.lane] for k in rows.closing.tolist()])
        ends[self.diverged[rows.closing]] = np.nan  # it has restarted
        read = recording.read[: self.count, self.lane]
        for column, numbers in zip(recording.probe.columns, rows.read(read, ends).T, strict=True):
            yield column.name, numbers, column.unit
        info = recording.info[: self.count]
        for name in dict.fromkeys(name for each in info for name in each):
            given = np.array([each[name][self.lane] if name in each else np.nan for each in info])
            yield f"info: {name}", rows.led(given), ""


def _family(family: str, names: Sequence[str], numbers: np.ndarray, units: str | Sequence[str] = "") -> _Named:
    each = [units] * len(names) if isinstance(units, str) else units
    for name, column, unit in zip(names, numbers.T, each, strict=True):
        yield f"{family}: {name}", column, unit


def _in_order(units: Mapping[str, str], names: Sequence[str]) -> list[str]:
    return [units.get(name, "") for name in names]


def joined(parts: Sequence[Columns]) -> Columns:
    """The columns of several lanes, one below the other; NaN where one of them lacks a column."""
    names: dict[str, str] = {}
    for part in parts:
        names |= {name: unit for name, (_, unit) in part.items()}
    sizes = [len(part["time"][0]) for part in parts]
    found: Columns = {}
    for name, unit in names.items():
        pieces = [part[name][0] if name in part else np.full(n, np.nan) for part, n in zip(parts, sizes, strict=True)]
        found[name] = np.concatenate(pieces), unit
    return found
