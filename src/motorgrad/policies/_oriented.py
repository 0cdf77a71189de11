"""Oriented local units: Gaussians of full covariance, and soft boxes whose axes turn."""

from typing import ClassVar, Self

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from motorgrad.policies._arguments import SizedTask
from motorgrad.policies._local import GaussianUnits, InitialGaussians, Limits, LocalGaussians, check_gaussians
from motorgrad.policies._parameters import fixed, in_structure
from motorgrad.policies._policy import check_shapes
from motorgrad.policies._soft_shapes import InitialSoftBoxes, SoftBoxes
from motorgrad.policies._starting import Initial, function_of, then


class OrientedGaussians(GaussianUnits):
    r"""Local Gaussian units of fixed height and full covariance, $p_i = p_\max \exp(-\frac12 \lVert z \rVert^2)$.

    With $u = y - \mu$, $z_j = e^{-\lambda_j}\,(u_j + \sum_{k<j} c_{jk} u_k)$: a triangular factor of the precision
    $\Sigma^{-1} = (I + C)'\,e^{-2\Lambda}\,(I + C)$, whose diagonal is stored as a logarithm, so that every covariance
    is positive definite and every positive definite covariance can be reached (Pourahmadi, 1999). $e^{\lambda_j}$ is
    the deviation of input $j$ at given values of the inputs before it, and $-c_{jk}$ says how its mean then follows
    these. With $C = 0$ the units are `LocalGaussians` (section 6.2.1 of the thesis, which leaves oriented units out).

    Score of firing: with $g_j = e^{-\lambda_j} z_j$, $\partial_\mu = (I + C)'\,g$, $\partial_{\lambda_j} = z_j^2$ and
    $\partial_{c_{jk}} = -g_j\,u_k$; of silence: the same times $-p/(1 - p)$.

    **Arguments:** `centre` and `log_width`, both `(units, inputs)`; `shear`, `(units, pairs)`, the entries of $C$ row
    by row, $c_{21}, c_{31}, c_{32}, \dots$; `p_max` and `log_width_limits` as for `LocalGaussians`.
    """

    aligned: ClassVar[bool] = False

    centre: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    log_width: Float[Array, "units inputs"] = eqx.field(converter=jnp.asarray)
    shear: Float[Array, "units pairs"] = eqx.field(converter=jnp.asarray)
    p_max: Float[Array, " units"] = fixed(converter=jnp.asarray, default=1.0)
    log_width_limits: Limits = eqx.field(static=True, default=None)

    def __check_init__(self) -> None:
        check_gaussians(self, self.p_max)
        check_shapes(self, (self.outputs, pairs(self.inputs)), "shear")

    @classmethod
    def of(cls, units: LocalGaussians) -> Self:
        """The same units, free to turn."""
        shear = jnp.zeros((units.outputs, pairs(units.inputs)), units.centre.dtype)
        return cls(
            centre=units.centre,
            log_width=units.log_width,
            shear=shear,
            p_max=units.p_max,
            log_width_limits=units.log_width_limits,
        )

    def log_height(self) -> Float[Array, " units"]:
        return jnp.log(self.p_max)

    def _scaled(self, observation: Float[Array, " inputs"]) -> Float[Array, "units inputs"]:
        away = observation - self.centre
        sheared = away + jnp.sum(_below(self.shear, self.inputs) * away[:, None, :], axis=-1)
        return sheared * jnp.exp(-self.log_width)

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        surprise = self._surprise(observation, action)[:, None]
        scaled = self._scaled(observation)
        slope = surprise * scaled * jnp.exp(-self.log_width)
        back = jnp.sum(_below(self.shear, self.inputs) * slope[:, :, None], axis=1)
        rows, columns = np.tril_indices(self.inputs, -1)
        away = observation - self.centre
        return in_structure(
            self,
            centre=slope + back,
            log_width=surprise * scaled**2,
            shear=-slope[:, rows] * away[:, columns],
        )

    def half_axes(self) -> Float[np.ndarray, "units inputs inputs"]:
        unit = np.eye(self.inputs)
        factor = np.exp(-np.asarray(self.log_width, float))[:, :, None] * (unit + _below(self.shear, self.inputs))
        return np.linalg.inv(factor)


class OrientedBoxes(SoftBoxes):
    r"""Soft boxes that turn: $p_i = \prod_j \sigma(k\,(h_j - v_j))\,\sigma(k\,(h_j + v_j))$, $v = R'(y - \mu)$.

    Each axis of a box has a length of its own and two opposed sigmoids, one per wall; the columns of $R$ are the
    directions of the axes (section 6.5.2 of the thesis, which names oriented boxes without a formula).
    $R = (I + A)(I - A)^{-1}$ is the Cayley transform of a skew-symmetric matrix $A$, in any number of inputs. It leaves
    out only half turns, and a box is the same if an axis points the other way: every orientation is reached, even with
    no entry of $A$ beyond 1 (O'Dorney, 2014). In two inputs, the angle is $2\arctan a$. With $A = 0$ the units are
    `SoftBoxes`.

    Score of firing: with the derivative $g$ of $\log p$ by $v$, $s = (I + A)^{-1}(y - \mu)$ and $t = (I - A)^{-1} g$,
    $\partial_\mu = -Rg$ and $\partial_{a_{ij}} = 2\,(s_i t_j - s_j t_i)$, the others as for `SoftBoxes`, in $v$; of
    silence: the same times $-p/(1 - p)$.

    **Arguments:** `centre`, `log_width` and `log_hardness` as for `SoftBoxes`, with lengths along the axes; `turn`,
    `(units, pairs)`, the entries of $A$ below the diagonal row by row, $a_{21}, a_{31}, a_{32}, \dots$
    """

    aligned: ClassVar[bool] = False

    turn: Float[Array, "units pairs"] = eqx.field(converter=jnp.asarray)

    def __check_init__(self) -> None:
        super().__check_init__()
        check_shapes(self, (self.outputs, pairs(self.inputs)), "turn")

    @classmethod
    def of(cls, boxes: SoftBoxes) -> Self:
        """The same boxes, free to turn."""
        turn = jnp.zeros((boxes.outputs, pairs(boxes.inputs)), boxes.centre.dtype)
        return cls(boxes.centre, boxes.log_width, boxes.log_hardness, turn)

    def _inverse(self) -> Float[Array, "units inputs inputs"]:
        """$(I + A)^{-1}$; its transpose is $(I - A)^{-1}$."""
        below = _below(self.turn, self.inputs)
        return _inverse(jnp.eye(self.inputs, dtype=below.dtype) + below - jnp.swapaxes(below, 1, 2))

    def _along(self, observation: Float[Array, " inputs"]) -> Float[Array, "units inputs"]:
        away = observation - self.centre
        # R' = (I - A)(I + A)^-1 = 2 (I + A)^-1 - I
        return 2 * jnp.sum(self._inverse() * away[:, None, :], axis=-1) - away

    def score(self, observation: Float[Array, " inputs"], action: Float[Array, " units"]) -> Self:
        score = super().score(observation, action)
        inverse = self._inverse()
        # for a box whose axes are the inputs, the score of the centre is minus that of the place
        by_place = -score.centre
        behind = jnp.sum(inverse * (observation - self.centre)[:, None, :], axis=-1)
        before = jnp.sum(inverse * by_place[:, :, None], axis=1)
        rows, columns = np.tril_indices(self.inputs, -1)
        turn = 2 * (behind[:, rows] * before[:, columns] - behind[:, columns] * before[:, rows])
        return eqx.tree_at(lambda each: (each.centre, each.turn), score, (by_place - 2 * before, turn))

    def half_axes(self) -> Float[np.ndarray, "units inputs inputs"]:
        rotation = 2 * np.swapaxes(np.asarray(self._inverse(), float), 1, 2) - np.eye(self.inputs)
        return rotation * np.exp(np.asarray(self.log_width, float))[:, None, :]


def pairs(inputs: int) -> int:
    """The number of pairs of inputs, which is that of the entries below a diagonal."""
    return inputs * (inputs - 1) // 2


def _below(entries: Float[Array, "units pairs"], inputs: int) -> Float[Array, "units inputs inputs"]:
    """The matrices with these entries below the diagonal, row by row, and zeros elsewhere."""
    rows, columns = np.tril_indices(inputs, -1)
    place = np.full((inputs, inputs), len(rows))
    place[rows, columns] = np.arange(len(rows))
    return jnp.concatenate([entries, jnp.zeros((len(entries), 1), entries.dtype)], axis=1)[:, place]


def _inverse(matrices: Float[Array, "units inputs inputs"]) -> Float[Array, "units inputs inputs"]:
    """The inverses of matrices $I + A$ with a skew-symmetric $A$, by elimination.

    No pivot is below 1, for what is left after every step still is a matrix whose symmetric part is at least $I$. So it
    takes no exchange of rows, and only operations that every format of an export has.
    """
    inputs = matrices.shape[-1]
    made = jnp.broadcast_to(jnp.eye(inputs, dtype=matrices.dtype), matrices.shape)
    for row in range(inputs):
        others = np.arange(inputs) != row
        factor = jnp.where(others, matrices[:, :, row] / matrices[:, row, row, None], 0)[:, :, None]
        matrices, made = (each - factor * each[:, row, None, :] for each in (matrices, made))
    return made / jnp.diagonal(matrices, axis1=1, axis2=2)[:, :, None]


class InitialOrientedGaussians(InitialGaussians):
    """Local Gaussian units of full covariance, which start round and of equal `width`, with centres drawn from
    U[`low`, `high`] in every input."""

    def start(self, task: SizedTask | int) -> Initial:
        return then(OrientedGaussians.of, super().start(task))  # type: ignore[arg-type]


oriented_gaussians = function_of(InitialOrientedGaussians)


class InitialOrientedBoxes(InitialSoftBoxes):
    """Soft boxes that turn, which start as cubes of equal `hardness` along the inputs, with centres drawn from
    U[`low`, `high`] in every input."""

    def start(self, task: SizedTask | int) -> Initial:
        return then(OrientedBoxes.of, super().start(task))  # type: ignore[arg-type]


oriented_boxes = function_of(InitialOrientedBoxes)
