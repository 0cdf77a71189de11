"""Search for numbers with high scores, by functions that are expensive, noisy, or fail occasionally.

`Space` describes the numbers. `Uniform`, `Boltzmann`, `Pulled`, `Annealing`, `Genetic`, `CmaEs`, `EvolutionStrategy`
and `BayesianOptimisation` are methods. `search` asks a method for candidates, has them scored, and tells it the scores,
and their gradients where the score function returns `WithGradients`. The meaning of the numbers does not matter to it.
"""

from motorgrad.search._annealing import Annealing
from motorgrad.search._bayesian import BayesianOptimisation
from motorgrad.search._evosax import CmaEs, EvolutionStrategy
from motorgrad.search._genetic import Genetic
from motorgrad.search._methods import Boltzmann, Method, State, Uniform
from motorgrad.search._pulled import Pulled
from motorgrad.search._search import Found, Score, WithGradients, search
from motorgrad.search._space import Range, Space, reflected

__all__ = [
    "Annealing",
    "BayesianOptimisation",
    "Boltzmann",
    "CmaEs",
    "EvolutionStrategy",
    "Found",
    "Genetic",
    "Method",
    "Pulled",
    "Range",
    "Score",
    "Space",
    "State",
    "Uniform",
    "WithGradients",
    "reflected",
    "search",
]
