"""Estimation of states that are not measured."""

import dataclasses
from typing import Any, ClassVar

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from motorgrad._errors import check
from motorgrad._linear_algebra import linear_solve
from motorgrad.schema import number
from timlab.blocks._linear import check_system
from timlab.diagram import Block, Moment, Port, Ports, Signals


@dataclasses.dataclass(frozen=True)
class KalmanFilter(Block):
    r"""Kalman filter of a linear system in discrete time (Kalman, 1960). It tracks the state also while nothing is
    sensed.

    The system is $x_{t+1} = A x_t + B u_t + w_t$, $y_t = C x_t + v_t$ with normal noise of the covariances $Q$ and $R$.
    A measurement corrects the mean $\hat x$ and the covariance $P$ of the state,

    $$K = P C' (C P C' + R)^{-1}, \qquad \hat x \leftarrow \hat x + K\,(y - C \hat x), \qquad
    P \leftarrow (I - K C)\,P\,(I - K C)' + K R K',$$

    and the model predicts the next, $\hat x \leftarrow A \hat x + B u$ and $P \leftarrow A P A' + Q$. While `sensed` is
    false there is no correction: the model alone goes on, and is ever less certain. The output `x` is the corrected
    estimate, `deviation` the standard deviation of each of its elements.

        tracker = KalmanFilter(a=((1.0, 0.01), (0.0, 1.0)), b=(0.0, 0.01), c=(1.0, 0.0), q=1e-6, r=1e-2)

    The matrices determine the shapes of the ports.
    """

    name: ClassVar[str] = "kalman filter"
    category: ClassVar[str] = "dynamics"

    a: Any = number(((1.0,),), help="$A$, a square list of rows")
    b: Any = number(((0.0,),), help="$B$, one row per state; a flat list for a scalar input")
    c: Any = number(((1.0,),), help="$C$, one column per state; a flat list for a scalar measurement")
    q: Any = number(0.01, help="$Q$, rows; or variances, one for each state or the same for all")
    r: Any = number(0.01, help="$R$, likewise for each measurement, above 0")
    initial: Any = number(0.0, help=r"$\hat x_0$, before the first measurement")
    uncertainty: Any = number(1.0, help="$P_0$, likewise for each state")

    def validate(self) -> None:
        states = check_system(self.a, self.b, self.c)
        self.check_broadcasts("initial", (states,))
        _check_covariance("q", self.q, states)
        _check_covariance("r", self.r, len(np.atleast_2d(self.c)), invertible=True)
        _check_covariance("uncertainty", self.uncertainty, states)

    @property
    def inputs(self) -> Ports:
        return {
            "y": Port(np.shape(self.c)[:-1], help="the measurement"),
            "u": Port(np.shape(self.b)[1:], feedthrough=False, default=0.0, help="what acts on the system"),
            "sensed": Port((), "bool", default=1.0, help="whether there is a measurement"),
        }

    @property
    def outputs(self) -> Ports:
        states = np.shape(self.a)[:1]
        return {
            "x": Port(states, help="the estimate"),
            "deviation": Port(states, help="its standard deviation"),
        }

    def init(self, uniforms: Array) -> PyTree[Array]:
        states = np.shape(self.a)[0]
        return jnp.broadcast_to(self.initial, (states,)), covariance(self.uncertainty, states)

    def output(self, state: PyTree[Array], inputs: Signals, now: Moment) -> Signals:
        mean, spread = self._corrected(state, inputs)
        return {"x": mean, "deviation": jnp.sqrt(jnp.maximum(jnp.diagonal(spread), 0.0))}

    def update(self, state: PyTree[Array], inputs: Signals, now: Moment) -> PyTree[Array]:
        mean, spread = self._corrected(state, inputs)
        moved = self.a @ mean + jnp.tensordot(self.b, inputs["u"], inputs["u"].ndim)
        return moved, self.a @ spread @ jnp.transpose(self.a) + covariance(self.q, len(mean))

    def _corrected(self, state: PyTree[Array], inputs: Signals) -> tuple[Array, Array]:
        """Mean and covariance after the measurement, if there is one."""
        mean, spread = state
        c = jnp.atleast_2d(self.c)
        noise = covariance(self.r, len(c))
        gain = linear_solve(c @ spread @ c.T + noise, c @ spread).T
        corrected = mean + gain @ (jnp.atleast_1d(inputs["y"]) - c @ mean)
        # Joseph's form stays positive where rounding would make (I − K C) P negative
        rest = jnp.eye(len(mean)) - gain @ c
        less = rest @ spread @ rest.T + gain @ noise @ gain.T
        return jnp.where(inputs["sensed"], corrected, mean), jnp.where(inputs["sensed"], less, spread)


def covariance(given: Any, size: int) -> Float[Array, "size size"]:
    """A covariance matrix from its rows, or from the variances of independent numbers, or one for all."""
    given = jnp.asarray(given)
    return given if given.ndim == 2 else jnp.diag(jnp.broadcast_to(given, (size,)))


def _check_covariance(name: str, given: Any, size: int, invertible: bool = False) -> None:
    """Refuse what is no covariance matrix of this size."""
    shape = np.shape(given)
    fits = shape in ((), (1,), (size,), (size, size))
    check(fits, f"{name}: shape", shape, f"(), ({size},) or ({size}, {size})")
    matrix = np.asarray(given, float)
    if matrix.ndim < 2:
        matrix = np.diag(np.broadcast_to(matrix, (size,)))
    check(np.allclose(matrix, matrix.T), name, given, "the same in rows and columns")
    least = np.linalg.eigvalsh(matrix).min()
    # of a matrix with a direction of no variance, rounding may make the least variance negative
    good = least > 0 if invertible else least >= -1e-9 * np.abs(matrix).max()
    check(good, name, given, f"variances {'above 0' if invertible else 'of 0 or above'} in every direction")
