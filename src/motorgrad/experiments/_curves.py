"""What experiments ask of learning curves."""

import numpy as np

from motorgrad.training import Run


def final(run: Run, quantity: str, share: float = 0.25) -> np.ndarray:
    """The mean of a quantity over the last part of training, for each seed."""
    values = run.curve(quantity)[1]
    return values[:, -max(1, round(share * values.shape[1])) :].mean(axis=1)


def first_time(decision: np.ndarray, happened: np.ndarray) -> np.ndarray:
    """When something happened first, NaN where it never did: `(records,)` and `(…, records)` to `(…)`."""
    return np.where(happened.any(-1), decision[happened.argmax(-1)], np.nan)


def moving_mean(values: np.ndarray, records: int) -> np.ndarray:
    """The mean of each record and those before it, so many in all: `(…, n)` to `(…, n + 1 − records)`."""
    return np.lib.stride_tricks.sliding_window_view(values, records, axis=-1).mean(-1)
