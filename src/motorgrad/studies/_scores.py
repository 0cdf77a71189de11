"""Scores of candidates by the driver of studies: each candidate of a search is a job."""

import dataclasses
import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from motorgrad._consent import allowed
from motorgrad._files import check_writable, read_json, write_atomically
from motorgrad.studies._driver import ATTEMPTS, On, drive
from motorgrad.studies._jobs import JobFolder, Outcome, Work

Candidate = Mapping[str, float]


class ScoreEach:
    """Scores for `motorgrad.search.search` in which every candidate is a job, on one machine or many.

    **Arguments:**

    - `score`: a function of one candidate, given by name, and a random generator; greater is better. With `on` other
      than `"here"` it must be a function of a module, which the workers import.
    - `out`: a folder, which keeps every score. The same search goes on from there.
    - `on`, `workers`, `threads`, `attempts`, `imports`, `progress` and `options`: as in `run_study`. They have no
      effect on any score.

    A candidate whose score fails is tried again and then set aside, with its reason; its score is NaN.

    ```python
    search(ScoreEach(speed_of, "runs/bodies", on="ray"), space, evaluations=240, out="runs/bodies.npz")
    ```
    """

    def __init__(
        self,
        score: Callable[[dict[str, float], np.random.Generator], float],
        out: Path | str,
        *,
        on: On = "here",
        workers: int = 0,
        threads: int = 1,
        attempts: int = ATTEMPTS,
        imports: Sequence[str] = (),
        progress: bool = False,
        options: Mapping[str, Any] | None = None,
    ):
        check_writable("out", Path(out), folder=True)
        self.score = score
        self.out = Path(out)
        self.job_settings = Work(threads, imports=tuple(imports), allowed=allowed())
        self.how: dict[str, Any] = {"on": on, "workers": workers, "attempts": attempts, "progress": progress}
        self.how["options"] = options

    def __call__(self, candidates: Sequence[Candidate], random: np.random.Generator) -> Float[np.ndarray, " batch"]:
        """The scores of a batch. **Raises** `KeyboardInterrupt` where Ctrl-C or SIGTERM stopped it."""
        seeds = random.integers(2**63, size=len(candidates)).tolist()
        jobs = [
            _Candidate(f"{number:04d}", self.score, dict(each), seed)
            for number, (each, seed) in enumerate(zip(candidates, seeds, strict=True))
        ]
        folder = _Round(self.out, jobs)
        if not drive(folder, self.job_settings, lambda learned: None, **self.how):
            raise KeyboardInterrupt
        return np.array([folder.scores.get(job.name, math.nan) for job in jobs])


@dataclasses.dataclass(frozen=True)
class _Candidate:
    """One candidate to score, with the seed of its random numbers."""

    name: str
    score: Callable[[dict[str, float], np.random.Generator], float]
    numbers: dict[str, float]
    seed: int

    def do(self, path: Path, job_settings: Work) -> Outcome:
        found = float(self.score(dict(self.numbers), np.random.default_rng(self.seed)))
        kept = {"candidate": self.numbers, "score": found if math.isfinite(found) else None}
        write_atomically(path / "score.json", json.dumps(kept, indent=1).encode())
        return Outcome(found)


def _score_in(file: Path) -> float:
    """The score that a candidate has, NaN where it has failed. **Raises** `ValueError` for a damaged file."""
    found = read_json(file)
    known = found.get("score", "") if isinstance(found, dict) else ""
    right = known is None or (isinstance(known, int | float) and not isinstance(known, bool))
    if not right:
        raise ValueError(f"{file}: damaged: must say the score of a candidate; delete it")
    return math.nan if known is None else float(known)


class _Round(JobFolder[_Candidate, float]):
    """The folder of a batch of candidates, named after what they are: the same batch finds its scores again."""

    noun = "scores"
    counted = "candidates"

    def __init__(self, path: Path, jobs: list[_Candidate]):
        asked = json.dumps([[job.numbers, job.seed] for job in jobs], sort_keys=True)
        super().__init__(path / hashlib.sha256(asked.encode()).hexdigest()[:16])
        self._jobs = jobs
        self.scores: dict[str, float] = {}
        for job in jobs:
            if (file := self.place(job) / "score.json").exists():
                self.scores[job.name] = _score_in(file)

    @property
    def jobs(self) -> list[_Candidate]:
        return self._jobs

    def place(self, job: _Candidate) -> Path:
        return self.path / job.name

    def saved(self, job: _Candidate) -> int:
        return 0

    def add(self, job: _Candidate, result: float) -> None:
        self.scores[job.name] = result

    def is_done(self, job: _Candidate) -> bool:
        return job.name in self.scores

    def about(self, job: _Candidate) -> dict[str, Any]:
        return {"candidate": job.numbers}
