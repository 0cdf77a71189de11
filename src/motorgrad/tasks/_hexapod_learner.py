"""The learner with which 24 muscles learn to walk."""

from collections.abc import Mapping
from typing import Any

BATCH = 160
"""Decisions of a step of the parameters."""
UPDATES = 1200
"""Steps of the parameters, after which annealed numbers are at their ends."""

MUSCLE_LEARNER: Mapping[str, Any] = {
    "policy": "hyperplanes",
    "estimator": {
        # generalised advantages: the trace's decay is the critic's discount times 0.95
        "trace": {"kind": "exponential", "decay": 0.9215},
        "baseline": {
            "kind": "critic",
            "features": {"squares": True, "actions": True},
            "discount": 0.97,
            "fit": {"kind": "least-squares", "rate": 1 / (20 * BATCH), "interval": BATCH},
        },
        "improve": BATCH,
        "normalization": {"rate": 1 / (10 * BATCH)},
        "entropy": {"kind": "annealed", "start": 0.05, "end": 0.0, "steps": UPDATES},
    },
    "metric": {
        "kind": "fisher",
        "rate": 1 / (20 * BATCH),
        "initial": 0.05,
        "damping": 0.01,
        "kl": {"kind": "annealed", "start": 0.03, "end": 0.003, "steps": UPDATES},
    },
    # the step's length is that of the KL limit: the natural gradient of a batch this small is longer
    "optimizer": {"learning_rate": 1.0},
    "averaging": {"start": UPDATES - 150},
}
