"""The table of a rollout: columns by name, with units."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pyarrow as pa

from motorgrad._errors import counted, unknown
from motorgrad._extras import require
from motorgrad.learning import Demonstrations
from motorgrad.training.rollouts._saving import save

if TYPE_CHECKING:
    import pandas as pd

KEYS = ("seed", "episode", "decision", "time")
"""The columns that say which moment a row is of."""


@dataclasses.dataclass(frozen=True, eq=False, repr=False)
class Rollout:
    """What happened at every moment of some episodes: a row for each moment, a column for each quantity.

    A column is called by its family and what it is of, such as `"muscle force: biceps"`. Every value of a row is that
    of its `time`; the page on rollouts describes all columns. Where there is no value it is NaN.

    - `arrow`: the table, whose fields have their `unit` as metadata.

    ```python
    run = mg.train("t-maze", steps=2_000, seeds=2, progress=False)
    table = mg.rollout(run, episodes=3)
    print(np.nansum(table.of(seed=0, episode=2)["reward"]))
    print(table.names("observation"))
    ```
    """

    arrow: pa.Table

    def __repr__(self) -> str:
        episodes = len(self.episodes())
        rows, columns = self.arrow.num_rows, self.arrow.num_columns
        return f"Rollout({counted(rows, 'row')} of {counted(episodes, 'episode')}, {counted(columns, 'column')})"

    def __len__(self) -> int:
        return self.arrow.num_rows

    def __getitem__(self, name: str) -> np.ndarray:
        """The values of a column `(rows,)`, or of all columns of a family, such as `"muscle force"`, `(rows, columns)`.
        **Raises** `ValueError` for a name that is neither, with the nearest one."""
        if name in self.columns:
            return self.arrow[name].to_numpy()
        return np.column_stack([self.arrow[each].to_numpy() for each in self._of_family(name)])

    @property
    def columns(self) -> list[str]:
        """The names of all columns."""
        return self.arrow.column_names

    @property
    def units(self) -> dict[str, str]:
        """The SI unit of each column: `"1"` for a pure number, empty where it is the task's own."""
        return {field.name: (field.metadata or {}).get(b"unit", b"").decode() for field in self.arrow.schema}

    @property
    def about(self) -> dict[str, str]:
        """What the table is of: the task, the mode, the version of motorgrad, and the seconds between two rows."""
        return {name.decode(): each.decode() for name, each in (self.arrow.schema.metadata or {}).items()}

    def names(self, family: str) -> list[str]:
        """What the columns of a family are of, in their order: `["biceps", "triceps"]` for `"muscle force"`. **Raises**
        `ValueError` for another name, with the nearest one."""
        return [name.partition(": ")[2] for name in self._of_family(family)]

    def _of_family(self, family: str) -> list[str]:
        found = [name for name in self.columns if name.startswith(f"{family}: ")]
        if not found:
            families = {name.partition(": ")[0] for name in self.columns}
            whole = ": " in family
            raise unknown("column", family, self.columns if whole else families)
        return found

    def episodes(self) -> list[tuple[int, int]]:
        """The seed and the number of every episode, in the order of the rows."""
        seed = self.arrow["seed"].to_numpy()
        episode = self.arrow["episode"].to_numpy()
        begins = np.flatnonzero(np.append(True, (np.diff(seed) != 0) | (np.diff(episode) != 0))[: len(seed)])
        return list(zip(seed[begins].tolist(), episode[begins].tolist(), strict=True))

    def of(self, seed: int | None = None, episode: int | None = None) -> Rollout:
        """The rows of one seed, or of one episode. **Raises** `ValueError` for one that is not there."""
        found = self.arrow
        known = self.episodes()
        import pyarrow.compute as pc  # it takes a while to load

        for place, (name, value) in enumerate({"seed": seed, "episode": episode}.items()):
            if value is None:
                continue
            known = [each for each in known if each[place] == value] or known
            there = sorted({each[place] for each in known})
            if value not in there:
                raise ValueError(f"{name} = {value!r}: must be one of {', '.join(map(str, there[:40]))}")
            found = found.filter(pc.equal(found[name], value))  # type: ignore[attr-defined]
        return Rollout(found)

    def to_numpy(self) -> np.ndarray:
        """All numbers `(rows, columns)`, in the order of `columns`; true is 1 and false is 0."""
        return np.column_stack([np.asarray(self.arrow[name].to_numpy(), float) for name in self.columns])

    def to_arrow(self) -> pa.Table:
        """The table, whose fields have their `unit` as metadata."""
        return self.arrow

    def to_pandas(self) -> pd.DataFrame:
        """The table in pandas; `attrs["units"]` has the units. **Raises** `MissingExtra` without pandas."""
        require("a data frame needs", "pandas", "pandas")
        found = self.arrow.to_pandas()
        found.attrs["units"] = self.units
        return found

    def demonstrations(self) -> Demonstrations:
        """The decisions as demonstrations, which `motorgrad.learning.imitate` learns from: what the policies saw, as
        the task scales it, and what they did. With running statistics of observations, the scale is that of each
        policy. **Raises** `ValueError` for a table without decisions."""
        inputs = any(name.startswith("input: ") for name in self.columns)
        seen = self["input" if inputs else "observation"]
        discrete = "action" in self.columns
        done = self["action"]
        made = np.isfinite(done if discrete else done[:, 0])
        begins = (np.diff(self["seed"]) != 0) | (np.diff(self["episode"]) != 0)
        episodes = np.append(0, np.cumsum(begins))[: len(self)]
        return Demonstrations(seen[made], done[made].astype(int) if discrete else done[made], episodes[made])

    def save(self, path: Path | str) -> Path:
        """Write the table to a file, whose ending says in which format: `.parquet`, where the metadata of its fields
        have the units; `.csv`, a line of names, then numbers; or `.sto`, one episode, for OpenSim, in its names for
        angles, velocities, activations and fibers, and in SI units, which its header names. All give back the same
        numbers. **Returns** the path. **Raises** `ValueError` for another ending, for a path where no file can be
        written, and for a `.sto` of several episodes."""
        return save(self.arrow, Path(path), self.units, self.about, self.episodes())


def table_of(columns: Mapping[str, tuple[Any, str]], about: Mapping[str, str]) -> Rollout:
    """The table of some columns: the numbers and the unit of each."""
    fields = [
        pa.field(name, pa.array(numbers[:0]).type, metadata={"unit": unit}) for name, (numbers, unit) in columns.items()
    ]
    arrays = [pa.array(numbers) for numbers, _ in columns.values()]
    return Rollout(pa.table(arrays, schema=pa.schema(fields, metadata=dict(about))))
