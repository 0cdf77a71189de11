r"""Analysis of linear systems: frequency response with margins, step response, root locus; and equilibria of runs.

    linear = linearise(run, ["force.value"], ["place.y"])
    bode(linear).figure()

The computations are those of python-control; `state_space` hands a linear system over to the rest of that library.
"""

import importlib
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Complex, Float

from motorgrad._arguments import check_arguments
from motorgrad._errors import check
from timlab.engine import Linear, Run, linearise

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def state_space(linear: Linear) -> Any:
    """A linear system as one of python-control, with the names of its states, inputs and outputs."""
    check_arguments(state_space, locals())
    control = _control()

    names = {"states": linear.states, "inputs": linear.inputs, "outputs": linear.outputs}
    plain = {kind: [each.replace(".", "_") for each in given] for kind, given in names.items()}  # no points there
    return control.ss(linear.A, linear.B, linear.C, linear.D, linear.tick, **plain)


ASYMPTOTIC = 1e5  # times the fastest pole: a response has its final slope by then


class Bode(NamedTuple):
    """The frequency response of one output to one input, and its margins.

    - `frequency` (rad/s), `magnitude` (output per input), `phase` (rad, without jumps).
    - `gain_margin`: by which factor the gain of a loop that is closed by this response may rise before it is unstable;
      `phase_margin` (rad): by how much its phase may fall. Infinite where nothing crosses.
    - `gain_crossover`, `phase_crossover` (rad/s): where the magnitude is 1, and where the phase is −π; NaN where
      nowhere.
    """

    frequency: Float[np.ndarray, " frequencies"]
    magnitude: Float[np.ndarray, " frequencies"]
    phase: Float[np.ndarray, " frequencies"]
    gain_margin: float
    phase_margin: float
    gain_crossover: float
    phase_crossover: float

    def figure(self) -> "Figure":
        """Magnitude in decibels and phase in degrees over frequency, with the margins."""
        from matplotlib.ticker import MaxNLocator

        from timlab.blocks._figure import COLOURS, picture

        figure, (above, below) = picture(6.5, 4.5, rows=2)
        above.semilogx(self.frequency, 20 * np.log10(self.magnitude), color=COLOURS[0])
        below.semilogx(self.frequency, np.degrees(self.phase), color=COLOURS[0])
        above.axhline(0, color="0.7", linewidth=0.8)
        below.axhline(-180, color="0.7", linewidth=0.8)
        for axes, crossing in ((below, self.gain_crossover), (above, self.phase_crossover)):
            if np.isfinite(crossing):
                axes.axvline(crossing, color=COLOURS[1], linewidth=1.0, linestyle="dashed")
        below.yaxis.set_major_locator(MaxNLocator(steps=[1.5, 3, 4.5, 9]))  # -180 among them
        margins = (20 * np.log10(self.gain_margin), " dB"), (np.degrees(self.phase_margin), "°")
        gain, phase = (f"{margin:.3g}{unit}" if np.isfinite(margin) else "∞" for margin, unit in margins)
        above.set_title(f"gain margin {gain}, phase margin {phase}", loc="left", fontsize=8)
        above.set_ylabel("magnitude (dB)")
        below.set(xlabel="frequency (rad/s)", ylabel="phase (°)")
        return figure


def bode(
    linear: Linear, input: int = 0, output: int = 0, frequencies: Float[np.ndarray, " frequencies"] | None = None
) -> Bode:
    """The frequency response from one input to one output, and its gain and phase margins.

    **Arguments:**

    - `linear`: the system, continuous or discrete.
    - `input`, `output`: their indices.
    - `frequencies` (rad/s): rising; by default a thousand that show all that happens.

    **Raises** `ValueError` for an index that does not exist, and where the input does not move the output.
    """
    check_arguments(bode, locals())
    control = _control()

    system = _answering(linear, input, output)
    if frequencies is None:
        found = control.frequency_response(system)
        low = found.frequency[0]
        high = found.frequency[-1]
        high = min(high, np.pi / linear.tick) if linear.tick else high
        frequencies = np.geomspace(low, high, 1000)
    response = control.frequency_response(system, np.asarray(frequencies, float))
    value = np.squeeze(response.complex)
    gain, phase, at_phase, at_gain = control.margin(system)
    fastest = np.abs(np.linalg.eigvals(linear.A)).max(initial=0.0)
    if not linear.tick and at_phase > ASYMPTOTIC * fastest > 0:
        gain, at_phase = np.inf, np.nan  # the phase only comes near to −π, and meets it by rounding
    return Bode(
        np.asarray(response.frequency),
        np.abs(value),
        np.unwrap(np.angle(value)),
        float(gain),
        float(np.radians(phase)),
        float(at_gain),
        float(at_phase),
    )


class StepResponse(NamedTuple):
    """The deviations of all outputs after a step of 1 of one input.

    - `times` (s), `outputs` (outputs, times), `names` of the outputs.
    - `rise_time`, `settling_time` (s; from 10 % to 90 %, and to within 2 %) and `overshoot` (as a part of the final
      value) of each output; NaN where it does not settle.
    """

    times: Float[np.ndarray, " times"]
    outputs: Float[np.ndarray, "outputs times"]
    names: list[str]
    rise_time: Float[np.ndarray, " outputs"]
    settling_time: Float[np.ndarray, " outputs"]
    overshoot: Float[np.ndarray, " outputs"]

    def figure(self) -> "Figure":
        """The outputs over time."""
        from timlab.blocks._figure import draw_series, finish, picture

        figure, axes = picture()
        for place, (name, values) in enumerate(zip(self.names, self.outputs, strict=True)):
            draw_series(axes, self.times, values[None], place, name)
        axes.margins(x=0)
        finish(axes, "time (s)", "", 1, self.names)
        return figure


def step_response(linear: Linear, input: int = 0, end: float | None = None) -> StepResponse:
    """The response of all outputs to a step of 1 of one input, from rest at the operating point.

    **Arguments:** the system; the index of the input; the `end` (s), by default when all has settled.

    **Raises** `ValueError` for an index that does not exist.
    """
    check_arguments(step_response, locals())
    control = _control()

    systems = [_single(linear, input, output) for output in range(len(linear.outputs))]
    times = np.asarray(control.step_response(state_space(linear), timepts=end, input=input).time)
    responses = [np.ravel(control.step_response(system, timepts=times).outputs) for system in systems]
    stable = bool(np.all(_decays(linear)))
    found = [control.step_info(system) if stable else {} for system in systems]

    def of(name: str, unit: float = 1.0) -> Float[np.ndarray, " outputs"]:
        return np.array([unit * float(each.get(name, np.nan)) for each in found])

    shown = np.array(responses).reshape(len(systems), len(times))
    return StepResponse(times, shown, linear.outputs, of("RiseTime"), of("SettlingTime"), of("Overshoot", 0.01))


class RootLocus(NamedTuple):
    """The poles of a loop that is closed by negative feedback of an output to an input, for several gains.

    - `gains`; `poles` (gains, states); `zeros` of the open loop, to which poles go for large gains.
    - `tick` (s): 0 for a continuous system, which is stable left of 0; a discrete one is so within the unit circle.
    """

    gains: Float[np.ndarray, " gains"]
    poles: Complex[np.ndarray, "gains states"]
    zeros: Complex[np.ndarray, " zeros"]
    tick: float

    def figure(self) -> "Figure":
        """The poles in the plane: crosses for the least gain, circles for the zeros, a line for each pole."""
        from timlab.blocks._figure import COLOURS, picture

        figure, axes = picture(4.5, 4.0)
        for place, path in enumerate(np.asarray(self.poles, complex).T):
            axes.plot(np.real(path), np.imag(path), color=COLOURS[place % len(COLOURS)], linewidth=1.2)
        axes.plot(self.poles[0].real, self.poles[0].imag, "x", color="0.2")
        axes.plot(np.real(self.zeros), np.imag(self.zeros), "o", color="0.2", fillstyle="none")
        if self.tick:
            angle = np.linspace(0, 2 * np.pi, 200)
            axes.plot(np.cos(angle), np.sin(angle), color="0.7", linewidth=0.8)
            axes.set_aspect("equal")
        else:
            axes.axvline(0, color="0.7", linewidth=0.8)
        unit = "" if self.tick else " (1/s)"
        axes.set(xlabel=f"real part{unit}", ylabel=f"imaginary part{unit}")
        return figure


def root_locus(
    linear: Linear, input: int = 0, output: int = 0, gains: Float[np.ndarray, " gains"] | None = None
) -> RootLocus:
    """The poles for gains of a negative feedback from one output to one input.

    **Arguments:** the system; the indices of input and output; the `gains`, by default from 0 on as far as poles move.

    **Raises** `ValueError` for an index that does not exist, and where the input does not move the output.
    """
    check_arguments(root_locus, locals())
    control = _control()

    system = _answering(linear, input, output)
    found = control.root_locus_map(system, gains=None if gains is None else np.asarray(gains, float))
    return RootLocus(np.asarray(found.gains), np.asarray(found.loci), np.asarray(found.zeros), linear.tick)


class Trim(NamedTuple):
    """An equilibrium: the `run` in this state, the values of the `inputs` and `outputs` by address, and the largest
    `residual`, by which a state changes in a tick or an output misses its value.
    """

    run: Run
    inputs: dict[str, float]
    outputs: dict[str, float]
    residual: float


MAX_NEWTON_STEPS = 50
MAX_STEP_HALVINGS = 12
CLOSE = 1e-5  # relative to the largest number; runs compute in single precision


def trim(run: Run, inputs: Sequence[str] = (), outputs: Mapping[str, float] | None = None, seed: int = 0) -> Trim:
    """Find an equilibrium near the present state of a run: a state that a tick leaves as it is.

    Newton's method, with steps halved until they help; each step is of least norm where there are several solutions.

        found = trim(run, ["force.value"], {"place.y": 2.0})
        linear = linearise(found.run, ["force.value"], ["place.y"])

    **Arguments:**

    - `run`: it is not advanced.
    - `inputs`: addresses of scalar parameters that may change, `"block.parameter"`.
    - `outputs`: values that scalar outputs are to have, by address, `"block.port"`.
    - `seed`: the row of the run.

    **Raises** `ValueError` where no equilibrium is found, with what moves most.
    """
    check_arguments(trim, locals())
    wanted = dict(outputs or {})
    for address in inputs:
        check(np.size(run[address]) == 1, "inputs", address, "addresses of single numbers")
    probe = run.fork()
    x = _packed(probe, seed)
    u = np.array([float(run[address]) for address in inputs])
    size = len(x)
    names = list(wanted)

    def missed(z: np.ndarray) -> tuple[np.ndarray, Linear]:
        _place(probe, run, z[:size], seed)
        for address, value in zip(inputs, z[size:], strict=True):
            probe[address] = float(value)
        linear = linearise(probe, inputs, names, discrete=True, seed=seed)
        after = probe.fork()
        after.advance(1)
        short = linear.output - np.array([wanted[name] for name in names]) if names else np.zeros(0)
        return np.concatenate([_packed(after, seed) - z[:size], short]), linear

    z = np.concatenate([x, u])
    gap, linear = missed(z)
    for _ in range(MAX_NEWTON_STEPS):
        if np.abs(gap).max(initial=0.0) <= CLOSE * max(1.0, np.abs(z).max(initial=0.0)) * max(probe.plan.tick, 1e-3):
            break
        slope = np.block([[linear.A - np.eye(size), linear.B], [linear.C, linear.D]])
        step = np.linalg.lstsq(slope, -gap, rcond=1e-9)[0]
        for halving in range(MAX_STEP_HALVINGS):
            there = z + step / 2**halving
            new, found = missed(there)
            if np.isfinite(new).all() and np.linalg.norm(new) < np.linalg.norm(gap):
                z, gap, linear = there, new, found
                break
        else:
            break
    residual = float(np.abs(gap).max(initial=0.0))
    if not residual <= 100 * CLOSE * max(1.0, np.abs(z).max(initial=0.0)):
        worst = [*linear.states, *names][int(np.abs(gap).argmax())]
        raise ValueError(
            f"trim: no equilibrium was found near the present state: {worst} still misses by {residual:.3g}"
        )
    missed(z)
    values = dict(zip(names, map(float, linear.output), strict=True))
    return Trim(probe, dict(zip(inputs, map(float, z[size:]), strict=True)), values, residual)


def _single(linear: Linear, input: int, output: int) -> Any:
    """The system from one input to one output."""
    for name, index, known in (("input", input, linear.inputs), ("output", output, linear.outputs)):
        whole = isinstance(index, int) and not isinstance(index, bool)
        check(whole and 0 <= index < len(known), name, index, f"an index of {', '.join(known) or 'none'}")
    control = _control()

    b = linear.B[:, [input]]
    c = linear.C[[output]]
    return control.ss(linear.A, b, c, linear.D[[output]][:, [input]], linear.tick)


def _answering(linear: Linear, input: int, output: int) -> Any:
    """The system from one input to one output. **Raises** `ValueError` where none leads to the other."""
    system = _single(linear, input, output)
    size = max(1.0, np.abs(linear.A).max(initial=0.0))
    reached = linear.B[:, input]
    moves = linear.D[output, input] != 0
    for _ in linear.states:
        moves |= bool(linear.C[output] @ reached)
        reached = linear.A @ reached / size
    name = f"{linear.inputs[input]} → {linear.outputs[output]}"
    check(moves, "input and output", name, "an output that the input moves, at the operating point of the system")
    return system


def _control() -> Any:
    """The library python-control, whose types a checker cannot follow; it is loaded when first needed."""
    return importlib.import_module("control")


def _decays(linear: Linear) -> np.ndarray:
    """For each pole, whether what it stands for dies away."""
    poles = np.linalg.eigvals(linear.A)
    return np.abs(poles) < 1 if linear.tick else poles.real < 0


def _float_leaves(run: Run) -> list[tuple[str, int]]:
    """The arrays of real numbers in a run's state, by identity and place, in the order of `linearise`."""
    blocks = run.state["blocks"]
    return [
        (placed.identity, place)
        for placed in run.plan.blocks
        if placed.identity in blocks
        for place, leaf in enumerate(jax.tree.leaves(blocks[placed.identity]["state"]))
        if np.issubdtype(leaf.dtype, np.floating)
    ]


def _packed(run: Run, seed: int) -> np.ndarray:
    """All real numbers in the state of one seed."""
    blocks = run.state["blocks"]
    parts = [jax.tree.leaves(blocks[identity]["state"])[place][seed].ravel() for identity, place in _float_leaves(run)]
    return np.concatenate([np.zeros(0), *parts]).astype(float)


def _place(probe: Run, run: Run, x: np.ndarray, seed: int) -> None:
    """Put numbers into the state of one seed, at the tick where `run` stands."""
    state: dict[str, Any] = {**probe.state, "tick": run.tick}
    start = 0
    for identity, place in _float_leaves(run):
        leaves, tree = jax.tree.flatten(state["blocks"][identity]["state"])
        size = leaves[place][seed].size
        leaves[place][seed] = x[start : start + size].reshape(leaves[place][seed].shape)
        state["blocks"][identity] = {**state["blocks"][identity], "state": jax.tree.unflatten(tree, leaves)}
        start += size
    probe.restore(state)
