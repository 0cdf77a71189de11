"""Special functions for targets that lack them, made of elementary ones."""

import functools

import numpy as np
from numpy.typing import DTypeLike

from motorgrad.export._builder import Builder

DEGREE = 24  # the error of the series is then below 1e-12


def special(b: Builder, name: str, x: int) -> int:
    """`erf`, `erfc`, `expm1` or `log1p` of an array, by a builder's elementary operations."""
    do = _Numbers(b, x)
    if name == "erf":
        return do("sub", 1.0, _erfc(do, x))
    return {"erfc": _erfc, "expm1": _expm1, "log1p": _log1p}[name](do, x)


class _Numbers:
    """The operations on an array's elements and on numbers of its type."""

    def __init__(self, b: Builder, x: int):
        self.b = b
        self.dtype = b.operations[x].dtype

    def __call__(self, kind: str, *operands: int | float, dtype: DTypeLike | None = None) -> int:
        given = [each if isinstance(each, int) else self.b.constant(np.asarray(each, self.dtype)) for each in operands]
        return self.b.elementwise(kind, *given, dtype=dtype)


def _expm1(do: _Numbers, x: int) -> int:
    """exp(x) − 1 without the loss of digits near 0 (Kahan; Higham, 2002, section 1.14.1)."""
    u = do("exp", x)
    less = do("sub", u, 1.0)
    near = do("mul", less, do("div", x, do("log", u)))
    far = do("or", do("eq", less, -1.0, dtype=bool), do("gt", u, 1e30, dtype=bool), dtype=bool)
    return do("select", do("eq", u, 1.0, dtype=bool), x, do("select", far, less, near))


def _log1p(do: _Numbers, x: int) -> int:
    """log(1 + x) without the loss of digits near 0, by the same method."""
    u = do("add", x, 1.0)
    near = do("mul", do("log", u), do("div", x, do("sub", u, 1.0)))
    far = do("gt", u, 1e30, dtype=bool)
    return do("select", do("eq", u, 1.0, dtype=bool), x, do("select", far, do("log", u), near))


def _erfc(do: _Numbers, x: int) -> int:
    r"""$\operatorname{erfc}|x| = t\exp(-x^2 + g(t))$ with $t = 1/(1 + |x|/2)$ and a Chebyshev series for $g$."""
    size = do("abs", x)
    t = do("div", 1.0, do("add", do("mul", size, 0.5), 1.0))
    twice = do("sub", do("mul", t, 4.0), 2.0)
    *rest, first = _series()[::-1]
    before: int | float = 0.0
    now: int | float = float(rest[0])
    for coefficient in rest[1:]:  # Clenshaw's recurrence
        before, now = now, do("add", do("sub", do("mul", twice, now), before), float(coefficient))
    g = do("add", do("sub", do("mul", do("mul", twice, 0.5), now), before), float(first))
    tail = do("mul", t, do("exp", do("sub", g, do("mul", size, size))))
    return do("select", do("lt", x, 0.0, dtype=bool), do("sub", 2.0, tail), tail)


@functools.cache
def _series() -> np.ndarray:
    """The Chebyshev coefficients of $g(t) = \\log(e^{x^2}\\operatorname{erfc}(x)/t)$ over t in [0, 1]."""
    from scipy.special import erfcx

    def g(t: np.ndarray) -> np.ndarray:
        return np.log(erfcx(2 / t - 2) / t)

    nodes = (np.polynomial.chebyshev.chebpts1(DEGREE + 1) + 1) / 2
    return np.polynomial.chebyshev.chebfit(2 * nodes - 1, g(nodes), DEGREE)
