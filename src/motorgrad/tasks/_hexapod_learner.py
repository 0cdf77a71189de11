"""The learner that 24 muscles learn to walk with."""

from collections.abc import Mapping
from typing import Any

BATCH = 160  # decisions to a step of the parameters
UPDATES = 1200  # steps of the parameters, at the end of which what is annealed has come to its end

MUSCLE_LEARNER: Mapping[str, Any] = {
    "policy": "hyperplanes",
    "improve": BATCH,
    # generalised advantages: the trace's decay is the critic's discount times 0.95
    "critic": "least-squares",
    "critic_discount": 0.97,
    "decay": 0.9215,
    "critic_squares": True,
    "critic_actions": True,
    "critic_rate": 1 / (20 * BATCH),
    "critic_interval": BATCH,
    "advantages": "normalised",
    "advantage_rate": 1 / (10 * BATCH),
    # the step's length is that of the limit: the natural gradient of a batch this small is longer
    "metric": "fisher",
    "metric_rate": 1 / (20 * BATCH),
    "metric_initial": 0.05,
    "damping": 0.01,
    "rate": 1.0,
    "metric_kl": 0.03,
    "metric_kl_end": 0.003,
    "metric_kl_steps": UPDATES,
    "entropy": 0.05,
    "entropy_end": 0.0,
    "entropy_steps": UPDATES,
    "average": True,
    "average_start": UPDATES - 150,
}
