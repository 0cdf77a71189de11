"""The search loop (ask, score, tell), stored after every round, and its result."""

import dataclasses
import hashlib
import json
import re
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check, check_integer
from motorgrad._files import check_writable, read_arrays, write_arrays
from motorgrad._progress import Progress
from motorgrad.search._evosax import CmaEs
from motorgrad.search._methods import Method, State
from motorgrad.search._space import Space


@dataclasses.dataclass(frozen=True, eq=False)
class WithGradients:
    """The scores of a batch and estimates of their gradients, for a score function to return in place of plain scores.

    A method that has no use for gradients ignores them.

    - `scores` (batch,): greater is better, NaN marks a failure.
    - `gradients` (batch, size): the derivative of each score by each number, in the numbers' own units and in the order
      in which the candidates name them; NaN where it is unknown.
    - `variances` (batch, size): the sampling variances of these estimates, at least 0; 0 for exact ones.

    ```python
    def score(candidates, random):
        x = np.array([each["x"] for each in candidates])
        return WithGradients(-(x**2), -2 * x[:, None], np.zeros((len(x), 1)))
    ```
    """

    scores: Sequence[float] | Float[np.ndarray, " batch"]
    gradients: Float[np.ndarray, "batch size"]
    variances: Float[np.ndarray, "batch size"]


Score = Callable[
    [list[dict[str, float]], np.random.Generator], Sequence[float] | Float[np.ndarray, " batch"] | WithGradients
]
"""The scores of a batch of candidates, given by name: greater is better, NaN marks a failure. Noisy scores must draw
their noise from the generator, so that the search is reproducible. `WithGradients` adds gradients."""
# purposes of a round's random numbers
_ASKS = 0
_SCORES = 1


@dataclasses.dataclass(frozen=True, eq=False)
class Found:
    """Everything a search has tried, in order.

    - `space`: the search space.
    - `candidates` (evaluations, size): in the numbers' own units.
    - `scores` (evaluations,): NaN for a failed candidate.
    - `batch`: candidates per round.
    """

    space: Space
    candidates: Float[np.ndarray, "evaluations size"]
    scores: Float[np.ndarray, " evaluations"]
    batch: int

    @property
    def curve(self) -> Float[np.ndarray, " evaluations"]:
        """The best score up to each evaluation; NaN before the first success."""
        return np.fmax.accumulate(self.scores)

    def ranked(self, count: int | None = None) -> list[tuple[dict[str, float], float]]:
        """The best `count` candidates, or all that did not fail, best first: numbers by name, and the score.

        A candidate tried several times has its mean score. With noisy scores, the best candidates were also lucky:
        evaluate some of them again before trusting their scores.
        """
        known = np.isfinite(self.scores)
        rows, which = np.unique(self.candidates[known], axis=0, return_inverse=True)
        mean = np.bincount(which.ravel(), self.scores[known]) / np.bincount(which.ravel())
        order = np.argsort(-mean, kind="stable")[:count]
        return [(dict(zip(self.space.names, rows[i].tolist(), strict=True)), float(mean[i])) for i in order]

    @property
    def best(self) -> dict[str, float]:
        """The numbers of the best candidate, by name. **Raises** `ValueError` if all failed."""
        ranked = self.ranked(1)
        check(ranked, "candidates that did not fail", len(ranked), "at least one")
        return ranked[0][0]

    def __repr__(self) -> str:
        failed = int(np.isnan(self.scores).sum())
        said = f", best score {self.ranked(1)[0][1]:.4g}" if failed < len(self.scores) else ""
        return f"Found({len(self.scores)} evaluations of {self.space.size} numbers, {failed} failed{said})"


def search(
    score: Score,
    space: Space,
    method: Method | None = None,
    *,
    evaluations: int,
    seed: int = 0,
    out: Path | str | None = None,
    progress: bool = True,
) -> Found:
    """Search for numbers with a high score.

    **Arguments:**

    - `score`: a function of a batch of candidates and a random generator (`Score`).
    - `space`: the numbers and their bounds.
    - `method`: by default `CmaEs()`.
    - `evaluations`: the greatest number of candidates to score, at least one round; only whole rounds are made.
    - `seed`: seed of all randomness, at least 0. The same search with the same seed gives the same result.
    - `out`: a file that stores the search after every round. If it exists, the search continues from it bit for bit;
      more `evaluations` extend it. None stores nothing.
    - `progress`: whether to show progress.

    **Returns:** everything that was tried.

    **Raises:** `ValueError` for a bad argument, for a wrong number of scores or gradients, or if `out` belongs to
    another search.

    ```python
    space = Space({"x": Range(-1.0, 1.0)})
    found = search(lambda batch, random: [-(each["x"] ** 2) for each in batch], space, evaluations=60)
    found.best
    ```
    """
    method = CmaEs() if method is None else method
    check_integer("seed", seed, 0)
    batch = method.batch(space.size)
    check_integer("evaluations", evaluations, batch)
    file = None if out is None else Path(out)
    marks = _marks(space, method, seed)
    if file is not None:
        check_writable("out", file)
    if file is None or not file.exists():
        state = method.begin(space.start)
        candidates = np.zeros((0, space.size))
        scores = np.zeros(0)
    else:
        state, candidates, scores = _read(file, marks, space)
    first = len(scores) // batch
    rounds = evaluations // batch
    with Progress(f"search by {type(method).__name__}", "evaluations", rounds * batch, first * batch, progress) as bar:
        for number in range(first, rounds):
            places, state = method.ask(state, np.random.default_rng([seed, number, _ASKS]))
            named = [space.named(each) for each in places]
            scored = score(named, np.random.default_rng([seed, number, _SCORES]))
            given = np.asarray(scored.scores if isinstance(scored, WithGradients) else scored, float)
            check(given.shape == (batch,), "scores.shape", given.shape, f"({batch},), one for each candidate")
            given = np.where(np.isfinite(given), given, np.nan)
            state = method.tell(state, places, given)
            if isinstance(scored, WithGradients):
                state = method.tell_gradients(
                    state, places, *_by_place(scored, space.slopes(places), np.isfinite(given))
                )
            candidates = np.concatenate([candidates, space.numbers(places)])
            scores = np.concatenate([scores, given])
            if file is not None:
                kept = {f"state.{name}": value for name, value in state.items()}
                write_arrays(file, {**kept, "candidates": candidates, "scores": scores, "mark": np.array(marks[0])})
            bar.update(len(scores), _facts(scores))
    return Found(space, candidates[: rounds * batch], scores[: rounds * batch], batch)


def _by_place(scored: WithGradients, slopes: np.ndarray, known: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Derivatives by the places, with their variances, NaN for candidates that failed."""
    gradients = np.asarray(scored.gradients, float)
    variances = np.asarray(scored.variances, float)
    for name, values in (("gradients", gradients), ("variances", variances)):
        check(values.shape == slopes.shape, f"{name}.shape", values.shape, f"{slopes.shape}, a row for each candidate")
    known = np.isfinite(gradients) & known[:, None]
    right = np.isfinite(variances) & (variances >= 0.0)
    check(right[known].all(), "variances", variances[known & ~right], "finite and at least 0 where a gradient is known")
    return np.where(known, gradients * slopes, np.nan), np.where(known, variances * slopes**2, np.nan)


def _read(file: Path, marks: list[str], space: Space) -> tuple[State, np.ndarray, np.ndarray]:
    stored = read_arrays(file)
    check(str(stored.get("mark")) in marks, "out", str(file), "new, or of a search with this space, method and seed")
    state = {name.removeprefix("state."): value for name, value in stored.items() if name.startswith("state.")}
    candidates, scores = (stored.get(name, np.zeros(())) for name in ("candidates", "scores"))
    whole = scores.ndim == 1 and candidates.shape == (len(scores), space.size)
    if not (whole and candidates.dtype.kind == scores.dtype.kind == "f"):
        raise ValueError(f"{file}: damaged: must hold scores and as many candidates; delete it, and it is made again")
    return state, candidates, scores


def _marks(space: Space, method: Method, seed: int) -> list[str]:
    """Fingerprints of what a stored search must have in common with this one to be continued: the one that is stored,
    and the one of spaces whose bounds were numbers of NumPy, as `PolicyScore` once gave them."""
    ranges = repr(dict(space.ranges))
    of_numpy = re.sub(r"(low|high|start)=(-?\d[\d.e+-]*)", r"\1=np.float64(\2)", ranges)
    asked = [{"space": each, "method": repr(method), "seed": int(seed)} for each in (ranges, of_numpy)]
    return [hashlib.sha256(json.dumps(each).encode()).hexdigest()[:16] for each in asked]


def _facts(scores: np.ndarray) -> str:
    failed = int(np.isnan(scores).sum())
    best = "" if failed == len(scores) else f"best {np.nanmax(scores):.4g}"
    return " · ".join(filter(None, [best, f"{failed} failed" if failed else ""]))
