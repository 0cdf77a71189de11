"""Linearisation of runs: the functions for everybody, which check their arguments."""

from collections.abc import Sequence

from motorgrad._arguments import check_arguments
from timlab.engine._linear import Linear, linearised, unstable_modes
from timlab.engine._run import Run


def linearise(
    run: Run, inputs: Sequence[str] = (), outputs: Sequence[str] = (), *, discrete: bool = False, seed: int = 0
) -> Linear:
    """Linearise a diagram about the current state, parameters and time of a run.

        linear = linearise(run, ["input.value"], ["level.y"])
        poles = numpy.linalg.eigvals(linear.A)

    **Arguments:**

    - `run`: it is not advanced.
    - `inputs`: addresses of parameters that are the system's inputs, `"block.parameter"`, such as an inlet's `value`.
    - `outputs`: addresses of outputs, `"block.port"`.
    - `discrete`: linearise one whole tick with all real-valued states; otherwise the continuous part, with everything
      else held.
    - `seed`: the row of the run.

    **Raises** `ValueError` for unknown addresses, and for host blocks, which have no derivatives.
    """
    check_arguments(linearise, locals())
    return linearised(run, inputs, outputs, discrete, seed)


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
    return unstable_modes(run, seed)
