"""Local units: the contract, Gaussian units of fixed and of learned height, and their layout over the inputs."""

import abc
from typing import ClassVar, Literal, Self

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Array, Float

from motorgrad._errors import check
from motorgrad.policies._arguments import SizedTask, sizes
from motorgrad.policies._binary import BinaryUnits
from motorgrad.policies._features import lattice
from motorgrad.policies._parameters import fixed, in_structure
from motorgrad.policies._starting import POSITIVE, SHARE_ABOVE_0, Initial, InitialPolicy, check_interval, function_of
from motorgrad.policies.abilities import Regions
from motorgrad.schema import count, static

CAP = 1e-6  # the closest that a probability comes to 1, for sampling and for the score alike
Limits = tuple[float, float] | None


class LocalUnits(BinaryUnits):
    """Binary units that fire only near a centre.

    Local units can be drawn in the plane, placed by a growing learner (`motorgrad.learning.Growth`), and judged by
    `reach`. What these need to know of a new kind of unit is declared here, as class attributes:

    - `size_field`: the field with the logarithm of a unit's half extent, `(units, inputs)` or `(units,)`; by default
      `log_width`.
    - `box`: true if units fire in a box, false if they fire in an ellipsoid.
    - `resizable`: whether a unit keeps its height when its size changes, as growth requires.
    - `aligned`: whether the axes of the box or ellipsoid are parallel to the inputs; if not, the kind defines
      `half_axes`.
    """

    size_field: ClassVar[str] = "log_width"
    box: ClassVar[bool] = False
    resizable: ClassVar[bool] = True
    aligned: ClassVar[bool] = True

    centre: eqx.AbstractVar[Float[Array, "units inputs"]]

    @property
    def inputs(self) -> int:
        return self.centre.shape[1]

    @property
    def outputs(self) -> int:
        return self.centre.shape[0]

    def half_axes(self) -> Float[np.ndarray, "units inputs inputs"]:
        """The half axes of each unit's box, or half axes of its ellipsoid, as columns."""
        half = np.exp(np.asarray(getattr(self, self.size_field), float))
        half = np.broadcast_to(half if half.ndim == 2 else half[:, None], self.centre.shape)
        return half[:, None, :] * np.eye(self.inputs)

    def regions(self) -> Regions:
        centre = np.asarray(self.centre)
        return Regions(centre, self.half_axes(), np.full(len(centre), self.box), np.ones(len(centre), bool))


class CappedUnits(LocalUnits):
    r"""Local units defined by a log-probability of firing $\log p_i(y)$ that may reach 0.

    $p$ is capped at $1 - 10^{-6}$, where the score is 0: the score of silence diverges as $p$ approaches 1. Elsewhere
    the score is $\nabla\log p$ for firing and $-p/(1 - p)$ times that for silence (appendix A.1 of the thesis).
    """

    @abc.abstractmethod
    def _log_fire(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        """Log-probability of firing, before the cap."""

    def prob(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return jnp.minimum(jnp.exp(self._log_fire(observation)), 1 - CAP)

    def log_probs(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        log_fire = jnp.minimum(self._log_fire(observation), jnp.log1p(-CAP))
        return jnp.where(action > 0, log_fire, jnp.log(-jnp.expm1(log_fire)))

    def _surprise(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Float[Array, " units"]:
        """d log π / d log p: 1 for firing, −p/(1 − p) for silence, 0 where p is capped."""
        log_fire = self._log_fire(observation)
        capped = log_fire >= jnp.log1p(-CAP)
        safe = jnp.where(capped, -1.0, log_fire)
        # −p/(1 − p) = 1/(1 − 1/p); with expm1 it is exact at both ends of (0, 1).
        silence = jnp.exp(safe) / jnp.expm1(safe)
        return jnp.where(capped, 0.0, jnp.where(action > 0, 1.0, silence))


class GaussianUnits(CappedUnits):
    r"""Units whose firing probability falls off as a Gaussian of the distance from a centre $\mu$.

    $\log p = \log h - \frac12\sum_j z_j^2$ with $z_j = (y_j - \mu_j)/\sigma_j$, widths $\sigma_j = e^{\lambda_j}$ and a
    height $h$ that the subclass defines. $p$ is capped as in `CappedUnits`.
    """

    log_width: eqx.AbstractVar[Float[Array, "units inputs"]]
    log_width_limits: eqx.AbstractVar[Limits]

    @abc.abstractmethod
    def log_height(self) -> Float[Array, " units"]:
        """Log-probability of firing at the centre, before the cap."""

    def limited(self) -> Self:
        if self.log_width_limits is None:
            return self
        return eqx.tree_at(lambda units: units.log_width, self, jnp.clip(self.log_width, *self.log_width_limits))

    def _scaled(self, observation: Float[Array, " inputs"]) -> Float[Array, "units inputs"]:
        return (observation - self.centre) * jnp.exp(-self.log_width)

    def _log_fire(self, observation: Float[Array, " inputs"]) -> Float[Array, " units"]:
        return self.log_height() - 0.5 * jnp.sum(self._scaled(observation) ** 2, axis=-1)


class LocalGaussians(GaussianUnits):
    r"""Local Gaussian units of fixed height, $p_i = p_\max \exp(-\frac12 \sum_j ((y_j - \mu_j)/\sigma_j)^2)$.

    Score of firing: $\partial_{\mu_j} = (y_j - \mu_j)/\sigma_j^2$ and
    $\partial_{\lambda_j} = ((y_j - \mu_j)/\sigma_j)^2$; of silence: the same times $-p/(1 - p)$ (section 6.2 of the
    thesis, but with a height that does not depend on the widths; for one that does, see `FreeGaussians`).

    **Arguments:** `centre` and `log_width`, both `(units, inputs)`; `p_max`, a number or `(units,)`, in (0, 1];
    `log_width_limits`, the bounds to which learning clips `log_width`, or `None`.
    """

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_width: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    p_max: Float[Array, " units"] = fixed(converter=jnp.asarray, default=1.0)
    log_width_limits: Limits = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        check_gaussians(self, self.p_max)

    def log_height(self) -> Float[Array, " units"]:
        return jnp.log(self.p_max)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = self._surprise(observation, action)[:, None]
        scaled = self._scaled(observation)
        return in_structure(self, centre=surprise * scaled * jnp.exp(-self.log_width), log_width=surprise * scaled**2)


class PrintedGaussians(LocalGaussians):
    r"""Local Gaussian units as section 6.2.2 of the thesis prints them: a biased pair of probability and score.

    The height is tied to the widths by equation 6.1, so that the probability is that of `LocalGaussians`; the score of
    the log-widths is that of a free height, $z_j^2 - 1$ for firing, and $-p/(1 - p)$ times that for silence. Its mean
    is 0, as that of any score, so that baselines add no bias, but it is not the derivative of the log-probability. Mean
    gradient samples for $\lambda_{ij}$ fall short of the gradient by the derivative of the objective $\eta$ by the
    logarithm of the unit's height $h_i$, in every input $j$ alike:

    $$\mathbb E\,[r\,\hat\partial_{\lambda_{ij}}\log\pi] =
    \frac{\partial\eta}{\partial\lambda_{ij}} - \frac{\partial\eta}{\partial\log h_i}$$

    For an immediate reward, the last term is $\mathbb E\,[p_i(y)\,(r_i^1(y) - r_i^0(y))]$, with the mean rewards
    $r_i^1$ and $r_i^0$ if the unit fires and if it does not: as soon as firing pays, widths shrink faster or grow less
    than the reward asks for. The gradient by the centres is exact, and so is the Fisher matrix.

    This class is for comparison with the thesis; use `LocalGaussians` to learn. Learners that differentiate the
    log-probability instead of asking for scores (`ProximalPolicyOptimization`) refuse it: the pair would have no
    effect.

    **Arguments:** those of `LocalGaussians`.
    """

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        exact = super().score(observation, action)
        surprise = self._surprise(observation, action)[:, None]
        return in_structure(self, centre=exact.centre, log_width=exact.log_width - surprise)

    def _fisher_rows(self, observation: Float[Array, " inputs"]) -> Float[Array, "units parameters"]:
        exact = LocalGaussians(centre=self.centre, log_width=self.log_width, p_max=self.p_max)
        return exact._fisher_rows(observation)


Pair = Literal["exact", "printed"]
"""Which score local Gaussian units of fixed height have: the derivative of the log-probability, or the printed one."""


GAUSSIANS: dict[Pair, type[LocalGaussians]] = {"exact": LocalGaussians, "printed": PrintedGaussians}
"""The classes of local Gaussian units, by their score."""


class FreeGaussians(GaussianUnits):
    r"""Local Gaussian units of learned height, $p_i = e^{\alpha_i}\,\prod_j \mathcal N(y_j; \mu_j, \sigma_j)$.

    The density is normalised as in equation 6.1 of the thesis: a unit that widens becomes lower, hence the $z^2 - 1$ in
    its score.

    Score of firing: $\partial_\alpha = 1$, $\partial_{\mu_j} = (y_j - \mu_j)/\sigma_j^2$ and
    $\partial_{\lambda_j} = z_j^2 - 1$; of silence: the same times $-p/(1 - p)$.

    **Arguments:** `centre` and `log_width`, both `(units, inputs)`; `log_mass` $\alpha$, `(units,)`;
    `log_width_limits` as for `LocalGaussians`.
    """

    resizable: ClassVar[bool] = False

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_width: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_mass: Float[Array, " units"] = eqx.field(converter=jnp.asarray)
    log_width_limits: Limits = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        check_gaussians(self)
        count = self.centre.shape[:1]
        check(self.log_mass.shape == count, "log_mass", self.log_mass.shape, f"of shape {count}")

    def log_height(self) -> Float[Array, " units"]:
        return self.log_mass - jnp.sum(self.log_width, axis=-1) - 0.5 * self.inputs * jnp.log(2 * jnp.pi)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = self._surprise(observation, action)
        scaled = self._scaled(observation)
        return in_structure(
            self,
            centre=surprise[:, None] * scaled * jnp.exp(-self.log_width),
            log_width=surprise[:, None] * (scaled**2 - 1),
            log_mass=surprise,
        )


def check_gaussians(units: GaussianUnits, p_max: Float[Array, " units"] | None = None) -> None:
    """Refuse Gaussian units whose arrays do not fit together, and a fixed height that is no probability."""
    shape = units.centre.shape
    check(units.centre.ndim == 2, "centre", shape, "of shape (units, inputs)")
    check(units.log_width.shape == shape, "log_width", units.log_width.shape, f"of shape {shape}")
    limits = units.log_width_limits
    check(limits is None or limits[0] < limits[1], "log_width_limits", limits, "None, or two numbers, low < high")
    if p_max is None:
        return
    check(p_max.shape in ((), shape[:1]), "p_max", p_max.shape, f"one number or of shape {shape[:1]}")
    if not isinstance(p_max, Tracer):  # a tracer has no value to check
        height = np.asarray(p_max)
        check(np.all((height > 0) & (height <= 1)), "p_max", height.tolist(), "in (0, 1]")


class StartsScattered:
    """What initial policies of local units have in common whose centres are drawn from U[`low`, `high`] in every
    input."""

    low: float
    high: float

    def validate(self) -> None:
        super().validate()  # type: ignore[misc]
        check_interval(self.low, self.high)

    def centres(self, key: jax.Array, units: int, inputs: int) -> Float[Array, "units inputs"]:
        """The centres of a seed."""
        return jax.random.uniform(key, (units, inputs), minval=self.low, maxval=self.high)


class InitialGaussians(StartsScattered, InitialPolicy):
    """Local Gaussian units of equal `width`, with centres drawn from U[`low`, `high`] in every input."""

    width: float = static(
        0.5, allowed=POSITIVE, help="the standard deviation of every unit, in the units of the inputs"
    )
    p_max: float = static(1.0, allowed=SHARE_ABOVE_0, help="the probability of firing at a unit's centre")
    low: float = static(-1.0, help="the lower end of the range of the centres in every input")
    high: float = static(1.0, help="its upper end")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)

        def initial(key: jax.Array) -> LocalGaussians:
            centre = self.centres(key, outputs, inputs)
            return LocalGaussians(centre, jnp.full_like(centre, jnp.log(self.width)), p_max=jnp.asarray(self.p_max))

        return initial


gaussians = function_of(InitialGaussians)


class InitialLaidOut(InitialPolicy):
    """Local Gaussian units laid out evenly over the range of the inputs."""

    copies: int = count(1, 1, help="consecutive units that share a centre")
    width: float = static(0.16, allowed=POSITIVE, help="a standard deviation, as a fraction of the range")
    p_max: float = static(1.0, allowed=SHARE_ABOVE_0, help="the probability of firing at a unit's centre")


class InitialTiles(InitialLaidOut):
    """Local Gaussian units laid out evenly over the range of the inputs (section 6.3 of the thesis).

    The range is the task's `observation_range`, [0, 1] for a task without one, or [`low`, `high`] in every input. The
    centres form a lattice with about as many rows as there are centres in a row. Each centre is shared by `copies`
    consecutive units, such as one that pushes left and one that pushes right. Learning clips the log-widths to the two
    limits.

    **Example:**

    ```python
    tiles(2, units=18, copies=2).centre.shape  # (18, 2): nine places in the unit square
    ```
    """

    low: float | None = static(None, help="the lower end of the range, by default the task's")
    high: float | None = static(None, help="the upper end of the range, by default the task's")
    least_log_width: float = static(-4.0, help="the lower limit of the logarithm of a width")
    most_log_width: float = static(2.0, help="the upper limit of the logarithm of a width")
    pair: Pair = static("exact", help="printed for the biased score that the thesis prints (`PrintedGaussians`)")

    def validate(self) -> None:
        super().validate()
        limits = (self.least_log_width, self.most_log_width)
        check(limits[0] < limits[1], "least_log_width, most_log_width", limits, "an interval")

    def start(self, task: SizedTask | int) -> Initial:
        inputs, outputs = sizes(task, self.units)
        check(self.copies <= outputs, "copies", self.copies, f"from 1 to the {outputs} units")
        ranges = input_ranges(task, inputs, self.low, self.high)
        extent = ranges[:, 1] - ranges[:, 0]
        places = ranges[:, 0] + extent * lattice(-(-outputs // self.copies), inputs)
        limits = (self.least_log_width, self.most_log_width)
        log_width = np.clip(np.log(self.width * extent), *limits)
        centre = jnp.asarray(np.repeat(places, self.copies, axis=0)[:outputs], jnp.result_type(float))
        widths = jnp.broadcast_to(jnp.asarray(log_width, centre.dtype), centre.shape)
        return GAUSSIANS[self.pair](centre, widths, p_max=jnp.asarray(self.p_max), log_width_limits=limits)


tiles = function_of(InitialTiles)


def input_ranges(task: SizedTask | int, inputs: int, low: float | None = None, high: float | None = None) -> np.ndarray:
    """The range of each input, `(inputs, 2)`: as given, else the task's, else [0, 1]."""
    spans = getattr(task, "observation_range", None) or [(0.0, 1.0)] * inputs
    ranges = np.array([(a if low is None else low, b if high is None else high) for a, b in spans])
    check((ranges[:, 0] < ranges[:, 1]).all(), "low, high", (low, high), "an interval, low < high, in every input")
    return ranges
