"""Features that linear units and critics see: products, fixed random or radial features, tiles."""

import functools
import math
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._tile_coding import TileCoding
from motorgrad.schema import Part, Range, count, static

Kind = Literal["tanh", "fourier", "radial", "grid"]


class FeatureMap(Part):
    r"""The inputs $y$ and fixed functions of them, side by side.

    Beside $n$ inputs, which should have a scale of about 1, there may be $K$ nonlinear features of one `shape`:

    | `shape` | $\varphi_k(y)$ | drawn once, from `seed` |
    |---|---|---|
    | `"tanh"` | $\tanh(c\,(w_k \cdot y/\sqrt n + b_k))$ | $w_k, b_k$ from $\mathcal N(0, 1)$ |
    | `"fourier"` | $\sqrt2\cos(c\,w_k \cdot y/\sqrt n + b_k)$ | $w_k$ likewise, $b_k$ from U[0, 2π) |
    | `"radial"` | $\exp(-c^2 \lVert y - \mu_k\rVert^2/2n)$ | $\mu_k$ from $\mathcal N(0, 1)$ |
    | `"grid"` | the same | nothing: $\mu_k$ are spread evenly over [−1, 1] in every input |

    Fourier features approximate the kernel of the radial ones (Rahimi & Recht, 2007); for these, see Broomhead & Lowe
    (1988). The random numbers come from NumPy's `RandomState`, whose streams never change. So the settings define the
    map completely, and a run stores nothing else of it. Last come the `tiles` of a `TileCoding`, if there is one.

    **Raises:** `ValueError` for a value out of range.

    ```python
    policy = mg.policies.hyperplanes(task, features=mg.policies.FeatureMap(nonlinear=64))
    ```
    """

    squares: bool = static(False, help="whether the squares of the inputs are among the features")
    products: bool = static(False, help="whether the products of all pairs of inputs are among the features")
    nonlinear: int = count(0, 0, 100_000, help="$K$, the number of nonlinear features")
    shape: Kind = static("tanh", help="the kind of nonlinear features")
    scale: float = static(
        1.0,
        allowed=Range(0, open_low=True),
        help="$c$; the greater, the shorter the distance between inputs that the features tell apart",
    )
    seed: int = count(0, 0, help="seed of the random numbers. All seeds of a run have the same features")
    tiles: TileCoding | None = static(None, help="overlapping grids, whose cells are features; by default none")
    raw: bool = static(True, help="whether the inputs themselves are among the features")

    def validate(self) -> None:
        super().validate()
        check(self.raw or self._more, "raw", self.raw, "True where there are no other features")

    @property
    def adds(self) -> bool:
        """Whether there is anything other than the inputs."""
        return self._more or not self.raw

    @property
    def _more(self) -> bool:
        return self.squares or self.products or self.nonlinear > 0 or self.tiles is not None

    def size(self, inputs: int) -> int:
        """The number of features for this number of inputs, including the inputs."""
        pairs = inputs * (inputs - 1) // 2
        tiles = 0 if self.tiles is None else self.tiles.size(inputs)
        return inputs * self.raw + inputs * self.squares + pairs * self.products + self.nonlinear + tiles

    def expanded(self, observation: Float[Array, "*decisions inputs"]) -> Float[Array, "*decisions features"]:
        """The inputs, their squares, their products, the nonlinear features and tiles, as far as there are any: of one
        observation or, in one product of matrices, of several in rows."""
        parts = [observation] if self.raw else []
        parts += [jnp.square(observation)] if self.squares else []
        if self.products:
            first, second = np.triu_indices(observation.shape[-1], 1)
            parts += [observation[..., first] * observation[..., second]]
        parts += [self._nonlinear(observation)] if self.nonlinear else []
        if self.tiles is not None:
            tiles = self.tiles.expanded if observation.ndim == 1 else jax.vmap(self.tiles.expanded)
            parts += [tiles(observation)]
        return jnp.concatenate(parts, axis=-1)

    def _nonlinear(self, observation: Float[Array, "*decisions inputs"]) -> Float[Array, "*decisions nonlinear"]:
        inputs = observation.shape[-1]
        drawn = _drawn(self.shape, self.nonlinear, inputs, self.seed)
        directions, offsets = (jnp.asarray(each, observation.dtype) for each in drawn)
        steepness = self.scale / math.sqrt(inputs)
        if self.shape in ("radial", "grid"):
            apart = steepness * (observation[..., None, :] - directions)
            return jnp.exp(-0.5 * jnp.sum(jnp.square(apart), axis=-1))
        if observation.ndim == 1:
            # A sum of products instead of a matrix product: XLA then rounds alike for one seed and for many.
            along = jnp.sum(directions * (steepness * observation), axis=-1)
        else:
            along = (steepness * observation) @ directions.T
        if self.shape == "tanh":
            return jnp.tanh(along + self.scale * offsets)
        return math.sqrt(2) * jnp.cos(along + offsets)


INPUTS = FeatureMap()
"""The inputs alone."""


@functools.lru_cache(maxsize=64)
def _drawn(shape: str, features: int, inputs: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Directions, or centres, `(features, inputs)`; and offsets `(features,)`."""
    drawn = np.random.RandomState(seed)
    directions = 2 * lattice(features, inputs) - 1 if shape == "grid" else drawn.standard_normal((features, inputs))
    offsets = 2 * np.pi * drawn.random_sample(features) if shape == "fourier" else drawn.standard_normal(features)
    return directions, offsets


def lattice(places: int, inputs: int) -> np.ndarray:
    """`places` points `(places, inputs)` spread evenly over the unit cube, at the centres of cells."""
    points = np.full((places, inputs), 0.5)
    for column in range(inputs - 1):
        rows = max(1, round(places ** (1 / (inputs - column))))
        if rows > 1:  # in the columns before, all are in the middle
            for n, part in enumerate(np.array_split(points[:, column:], rows)):
                part[:, 0] = (n + 0.5) / rows
                part[:, 1:] = lattice(*part[:, 1:].shape)
            return points
    points[:, -1] = (np.arange(places) + 0.5) / places
    return points
