"""What only some policies can do: for each ability a small protocol, and for each question a function of any policy.

A policy has an ability when its class defines the methods of the protocol; it need not inherit from it. The functions
here take every policy. They ask a policy that has the ability, then the policy by which it acts or the parts of which
it is made, and otherwise give the plain answer, such as no memory.

```python
from motorgrad.policies import abilities

if abilities.has_memory(policy):
    memory = abilities.initial_memory(policy)
```
"""

from motorgrad.policies.abilities._batches import (
    BatchSums,
    entropy_sum,
    score_sum,
    score_sum_one_by_one,
    sums_batches,
)
from motorgrad.policies.abilities._delegation import ActsByAnother
from motorgrad.policies.abilities._distribution import (
    EntropyEstimate,
    FiniteActions,
    LocalRegions,
    Regions,
    Temperature,
    entropy_estimate,
    enumerate,
    has_temperature,
    regions,
    with_temperature,
)
from motorgrad.policies.abilities._fisher import (
    FisherCoordinates,
    FisherMatrices,
    FisherSum,
    UnitBlocks,
    blocks,
    fisher,
    fisher_coordinates,
    fisher_sum,
    fisher_sum_one_by_one,
    from_blocks,
    sampled_fisher,
)
from motorgrad.policies.abilities._hidden_units import (
    HiddenLayers,
    HiddenUnits,
    has_hidden_units,
    hidden_activations,
    task_action,
)
from motorgrad.policies.abilities._learned import (
    FixedEntries,
    ParameterLimits,
    RunningStatistics,
    adapted,
    allowed,
    limited,
)
from motorgrad.policies.abilities._memory import (
    CriticObservation,
    LastingNoise,
    Memory,
    ParameterMemory,
    critic_observation,
    has_exact_score,
    has_memory,
    initial_memory,
    marginal,
    observation_with_memory,
    remember,
    remembers_parameters,
)

__all__ = [
    "ABILITIES",
    "ActsByAnother",
    "BatchSums",
    "CriticObservation",
    "EntropyEstimate",
    "FiniteActions",
    "FisherCoordinates",
    "FisherMatrices",
    "FisherSum",
    "FixedEntries",
    "HiddenLayers",
    "HiddenUnits",
    "LastingNoise",
    "LocalRegions",
    "Memory",
    "ParameterLimits",
    "ParameterMemory",
    "Regions",
    "RunningStatistics",
    "Temperature",
    "UnitBlocks",
    "adapted",
    "allowed",
    "blocks",
    "check_whole",
    "critic_observation",
    "entropy_estimate",
    "entropy_sum",
    "enumerate",
    "fisher",
    "fisher_coordinates",
    "fisher_sum",
    "fisher_sum_one_by_one",
    "from_blocks",
    "has_exact_score",
    "has_hidden_units",
    "has_memory",
    "has_temperature",
    "hidden_activations",
    "initial_memory",
    "limited",
    "marginal",
    "observation_with_memory",
    "regions",
    "remember",
    "remembers_parameters",
    "sampled_fisher",
    "score_sum",
    "score_sum_one_by_one",
    "sums_batches",
    "task_action",
    "with_temperature",
]

ABILITIES: tuple[type, ...] = (
    Memory,
    ParameterMemory,
    LastingNoise,
    CriticObservation,
    HiddenUnits,
    HiddenLayers,
    UnitBlocks,
    BatchSums,
    FisherMatrices,
    FisherSum,
    FisherCoordinates,
    Temperature,
    LocalRegions,
    FiniteActions,
    EntropyEstimate,
    ParameterLimits,
    FixedEntries,
    RunningStatistics,
)
"""The protocols of all abilities."""


def check_whole(kind: type) -> None:
    """Refuse a class of policies that has a part of an ability, which would be taken for none.

    **Raises:** `TypeError` that names the ability and what is missing.
    """
    for ability in ABILITIES:
        names = [name for name in vars(ability) if not name.startswith("_")]
        missing = [name for name in names if not hasattr(kind, name)]
        if missing and len(missing) < len(names):
            own = ", ".join(name for name in names if name not in missing)
            raise TypeError(f"{kind.__name__}: has {own} of {ability.__name__}, but not {', '.join(missing)}")
