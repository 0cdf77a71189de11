"""The rows of a table: where the moments of decisions are in it, and when they were."""

import numpy as np


class Rows:
    """The rows of one lane, whose episodes `ended` there `(decisions,)`: for each of the `readings` of a decision the
    moment at which it begins, and one more at the end of an episode."""

    def __init__(self, ended: np.ndarray, readings: int):
        count = len(ended)
        closes = ended.copy()
        closes[-1:] = True
        before = np.cumsum(closes) - closes  # closing rows before each decision
        self.starts = readings * np.arange(count) + before
        """The row at which each decision begins."""
        self.nexts = self.starts + readings
        """The row to which it leads."""
        self.closing = np.flatnonzero(closes)
        """The decisions with which an episode, or the rollout, ends."""
        self.count = readings * count + int(closes.sum())
        self._readings = readings
        first = np.append(0, np.flatnonzero(ended) + 1)
        self.episode_of = np.cumsum(ended) - ended  # of each decision
        self.within = np.arange(count) - first[self.episode_of]
        """The decisions of the episode before each."""

    def starting(self, values: np.ndarray, closing: np.ndarray | None = None) -> np.ndarray:
        """Values of the moments at which decisions begin, `(decisions, …)`, and of the end of those that close."""
        found = self._blank(values)
        found[self.starts] = values
        if closing is not None:
            found[self.nexts[self.closing]] = closing[self.closing]
        return found

    def led(self, values: np.ndarray) -> np.ndarray:
        """Values of the moments to which decisions lead, `(decisions, …)`."""
        found = self._blank(values)
        found[self.nexts] = values
        return found

    def read(self, values: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Values of every reading, `(decisions, readings, …)`, and of the end of those decisions that close."""
        found = self._blank(values[:, 0])
        for k in range(self._readings):
            found[self.starts + k] = values[:, k]
        found[self.nexts[self.closing]] = ends
        return found

    def moments(self, period: float, step: float) -> dict[str, np.ndarray]:
        """`episode`, `decision`, the number of those made in the episode, and the `time` in it, of every row."""
        kinds = {"episode": np.int64, "decision": np.int64, "time": float}
        found = {name: np.zeros(self.count, kind) for name, kind in kinds.items()}
        for k in range(self._readings + 1):
            which = np.arange(len(self.starts)) if k < self._readings else self.closing
            rows = self.starts[which] + k
            within = self.within[which]
            found["episode"][rows] = self.episode_of[which]
            found["decision"][rows] = within + (k == self._readings)
            # of whole numbers, as a clock that is added to would be wrong by rounding
            found["time"][rows] = (within + (k == self._readings)) * period + (k % self._readings) * step
        return found

    def _blank(self, values: np.ndarray) -> np.ndarray:
        if values.dtype == bool:
            return np.zeros((self.count, *values.shape[1:]), bool)
        # in double precision, so that texts of numbers give back the same numbers
        return np.full((self.count, *values.shape[1:]), np.nan)
