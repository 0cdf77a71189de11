"""What a run has of the evaluations that were made while it learned."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pyarrow as pa
from jaxtyping import Float, Int

from motorgrad._errors import check, choice


class Evaluated:
    """The part of a `Run` that is about evaluations while training (`EvaluationCallback`, `KeepBest`)."""

    config: dict[str, Any]
    decision: int
    path: Path | None
    _evaluations: Mapping[str, np.ndarray]

    def evaluated(self, quantity: Literal["return", "length"] = "return") -> tuple[np.ndarray, np.ndarray]:
        """The evaluations that were made while training (`EvaluationCallback`): `(evaluations,)` and
        `(seeds, evaluations)`, in a sweep of all lanes.

        **Returns** the decision of each, and the means over its episodes. **Raises** `ValueError` where there are none.
        """
        choice("quantity", quantity, ("return", "length"))
        found = self._found_evaluations()
        return found["decision"], found[f"{quantity}s"].mean(axis=2, dtype=float)

    @property
    def evaluations(self) -> pa.Table:
        """The episodes of all evaluations that were made while training, a row for each: `seed`, in a sweep `setting`,
        `decision`, `episode`, `return`, `length`, and whether it `diverged` or was `cut`."""
        found = self._found_evaluations()
        lanes, times, episodes = found["returns"].shape
        lane, time, episode = (each.ravel() for each in np.indices((lanes, times, episodes)))
        seeds = self.config["run"]["seeds"]
        columns = {"seed": np.array(seeds)[lane % len(seeds)]}
        if self.config.get("sweep"):
            columns["setting"] = lane // len(seeds)
        columns |= {"decision": found["decision"][time], "episode": episode}
        names = {"return": "returns", "length": "lengths", "diverged": "diverged", "cut": "cut"}
        return pa.table(columns | {name: found[array].ravel() for name, array in names.items()})

    @property
    def best_at(self) -> Int[np.ndarray, " lanes"]:
        """After how many decisions each of the `best` policies was kept. **Raises** `ValueError` where none was."""
        return self._kept("at")

    @property
    def best_value(self) -> Float[np.ndarray, " lanes"]:
        """The mean over its episodes with which each of the `best` policies was chosen, which is too good an estimate.
        **Raises** `ValueError` where none was."""
        return self._kept("value")

    def _kept(self, name: str) -> np.ndarray:
        found = self._found_evaluations()
        check("best.at" in found, "best", self, "of a run that kept it: train(..., callbacks=mg.training.KeepBest())")
        return found[f"best.{name}"]

    def _found_evaluations(self) -> Mapping[str, np.ndarray]:
        """What evaluations while training found, by name."""
        if not self._evaluations:
            every = self.config["run"].get("evaluate_every")
            why = (
                "callbacks=mg.training.EvaluationCallback() makes some"
                if every is None
                else f"the first is due at {every:,} decisions, and {self.decision:,} were made"
            )
            raise ValueError(f"{self.path or 'the run'}: has no evaluations: {why}")
        return self._evaluations
