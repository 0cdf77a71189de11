"""What a search has found."""

import dataclasses

import numpy as np
from jaxtyping import Float

from motorgrad._errors import check
from motorgrad.search._space import Space


@dataclasses.dataclass(frozen=True, eq=False)
class Found:
    """All that a search has tried, in its order.

    - `space`: what was searched.
    - `candidates` (evaluations, size): in the numbers' own units.
    - `scores` (evaluations,): NaN where one failed.
    - `batch`: candidates of a round.
    """

    space: Space
    candidates: Float[np.ndarray, "evaluations size"]
    scores: Float[np.ndarray, " evaluations"]
    batch: int

    @property
    def curve(self) -> Float[np.ndarray, " evaluations"]:
        """The greatest score up to each evaluation; NaN before the first that did not fail."""
        return np.fmax.accumulate(self.scores)

    def ranked(self, count: int | None = None) -> list[tuple[dict[str, float], float]]:
        """The best candidates, or all that did not fail, best first: their numbers by name, and the score.

        One that was tried several times counts by its mean score. Where scores are noisy, the best were lucky too: try
        some of them again before believing their scores.
        """
        known = np.isfinite(self.scores)
        rows, which = np.unique(self.candidates[known], axis=0, return_inverse=True)
        mean = np.bincount(which.ravel(), self.scores[known]) / np.bincount(which.ravel())
        order = np.argsort(-mean, kind="stable")[:count]
        return [(dict(zip(self.space.names, rows[i].tolist(), strict=True)), float(mean[i])) for i in order]

    @property
    def best(self) -> dict[str, float]:
        """The numbers of the best candidate, by name. **Raises** `ValueError` where all failed."""
        ranked = self.ranked(1)
        check(ranked, "candidates that did not fail", len(ranked), "at least one")
        return ranked[0][0]

    def __repr__(self) -> str:
        failed = int(np.isnan(self.scores).sum())
        said = f", best score {self.ranked(1)[0][1]:.4g}" if failed < len(self.scores) else ""
        return f"Found({len(self.scores)} evaluations of {self.space.size} numbers, {failed} failed{said})"
