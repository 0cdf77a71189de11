"""Whether fixed steps are short enough."""

from typing import Any

import numpy as np

from motorgrad._arguments import check_arguments
from timlab.compiler import rk4_growth
from timlab.engine._linearise import Linear, linearise
from timlab.engine._run import Run


def unstable_steps(run: Run, seed: int = 0) -> list[str]:
    r"""The modes of a diagram that die out, but grow under its fixed RK4 steps: a line for each, which names the block
    that takes the largest part in it.

        for line in timlab.unstable_steps(run):
            print(line)

    The diagram is linearised about the current state. RK4 multiplies a mode of rate $\lambda$ by
    $R(z) = 1 + z + z^2/2 + z^3/6 + z^4/24$ in a step, $z = h\lambda$; its part in a block is the product of the right
    and left eigenvectors' entries (Pérez-Arriaga, Verghese & Schweppe, 1982).

    **Arguments:** the run, which is not advanced; the row of the seed.

    **Returns** an empty list for solvers that adapt their steps, and where all modes are stable.

    **Raises** `ValueError` as `linearise` does.
    """
    check_arguments(unstable_steps, locals())
    if run.plan.solver.adapts or not any(placed.block.is_continuous for placed in run.plan.blocks):
        return []
    return _lines(linearise(run, seed=seed), run.plan.tick / run.plan.solver.substeps)


def _lines(linear: Linear, step: float) -> list[str]:
    matrix = linear.A.astype(float)
    if not np.isfinite(matrix).all():
        return []
    rates: Any
    rates, right = np.linalg.eig(matrix)
    left = np.linalg.pinv(right)
    growth = rk4_growth(step * rates)
    lines: dict[str, str] = {}
    for n in np.flatnonzero((rates.real < 0) & (growth > 1 + 1e-5)):
        block = linear.states[int(np.argmax(np.abs(right[:, n] * left[n])))].partition("[")[0]
        lines.setdefault(
            block,
            f"{block}: RK4 steps of {step:g} s are unstable: they multiply a part that dies out at "
            f"{-rates[n].real:.3g} per second by {growth[n]:.3g} in each step; use a shorter tick, more substeps, or "
            'solver="rodas5p"',
        )
    return list(lines.values())
