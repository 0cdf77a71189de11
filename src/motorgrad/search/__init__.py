"""Search for numbers that score well, by functions that are dear, noisy, or fail now and then.

`Space` says what is searched; `Uniform`, `Boltzmann` and `CmaEs` are methods; `search` asks one for candidates, has
them scored, and tells it. It knows nothing of what the numbers mean.
"""

from motorgrad.search._boltzmann import Boltzmann
from motorgrad.search._cma_es import CmaEs
from motorgrad.search._found import Found
from motorgrad.search._method import Method, State
from motorgrad.search._search import Score, search
from motorgrad.search._space import Range, Space, reflected
from motorgrad.search._uniform import Uniform

__all__ = [
    "Boltzmann",
    "CmaEs",
    "Found",
    "Method",
    "Range",
    "Score",
    "Space",
    "State",
    "Uniform",
    "reflected",
    "search",
]
