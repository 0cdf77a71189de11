"""The loop of a search: ask, score, tell; stored after every round."""

import hashlib
import json
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad._files import check_writable, read_arrays, write_arrays
from motorgrad._progress import Progress
from motorgrad.search._checks import whole
from motorgrad.search._cma_es import CmaEs
from motorgrad.search._found import Found
from motorgrad.search._method import Method, State
from motorgrad.search._space import Space

Score = Callable[[list[dict[str, float]], np.random.Generator], Sequence[float] | Float[np.ndarray, " batch"]]
"""Scores of a batch of candidates, each its numbers by name: the greater the better, NaN for one that failed. If scores
are noisy, their noise comes from the generator, so that the search can be done again."""

_ASKS, _SCORES = 0, 1  # what a round's random numbers are for


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
    """Look for numbers with a great score.

    **Arguments:**

    - `score`: a function of a batch of candidates and a generator of random numbers (`Score`).
    - `space`: the numbers and their bounds.
    - `method`: by default `CmaEs()`.
    - `evaluations`: candidates that are scored, at most: only whole rounds are, and at least one.
    - `seed`: of all chance, at least 0. The same search with the same seed finds the same.
    - `out`: a file that keeps the search after every round. Where it is there already, the search goes on from it, and
      what follows is the same to the last bit; with more `evaluations` it can be made longer. None keeps nothing.
    - `progress`: whether to show it.

    **Returns** all that was tried.

    **Raises:** `ValueError` for a bad argument, for scores of another number than there are candidates, or where `out`
    is of another search.
    """
    method = CmaEs() if method is None else method
    whole("seed", seed, 0)
    batch = method.batch(space.size)
    whole("evaluations", evaluations, batch)
    file = None if out is None else Path(out)
    mark = _mark(space, method, seed)
    if file is not None:
        check_writable("out", file)
    state, candidates, scores = _begin(space, method) if file is None or not file.exists() else _read(file, mark, space)
    first, rounds = len(scores) // batch, evaluations // batch
    with Progress(f"search by {type(method).__name__}", "evaluations", rounds * batch, first * batch, progress) as bar:
        for number in range(first, rounds):
            places, state = method.ask(state, np.random.default_rng([seed, number, _ASKS]))
            named = [space.named(each) for each in places]
            given = np.asarray(score(named, np.random.default_rng([seed, number, _SCORES])), float)
            check(given.shape == (batch,), "scores.shape", given.shape, f"({batch},), one for each candidate")
            given = np.where(np.isfinite(given), given, np.nan)
            state = method.tell(state, places, given)
            candidates, scores = np.concatenate([candidates, space.numbers(places)]), np.concatenate([scores, given])
            if file is not None:
                kept = {f"state.{name}": value for name, value in state.items()}
                write_arrays(file, {**kept, "candidates": candidates, "scores": scores, "mark": np.array(mark)})
            bar.update(len(scores), _facts(scores))
    return Found(space, candidates[: rounds * batch], scores[: rounds * batch], batch)


def _begin(space: Space, method: Method) -> tuple[State, np.ndarray, np.ndarray]:
    return method.begin(space.start), np.zeros((0, space.size)), np.zeros(0)


def _read(file: Path, mark: str, space: Space) -> tuple[State, np.ndarray, np.ndarray]:
    stored = read_arrays(file)
    check(str(stored.get("mark")) == mark, "out", str(file), "new, or of a search with this space, method and seed")
    state = {name.removeprefix("state."): value for name, value in stored.items() if name.startswith("state.")}
    return state, stored["candidates"], stored["scores"]


def _mark(space: Space, method: Method, seed: int) -> str:
    """What a stored search must have in common with this one to go on."""
    asked: dict[str, Any] = {"space": repr(dict(space.ranges)), "method": repr(method), "seed": int(seed)}
    return hashlib.sha256(json.dumps(asked).encode()).hexdigest()[:16]


def _facts(scores: np.ndarray) -> str:
    failed = int(np.isnan(scores).sum())
    best = "" if failed == len(scores) else f"best {np.nanmax(scores):.4g}"
    return " · ".join(filter(None, [best, f"{failed} failed" if failed else ""]))
