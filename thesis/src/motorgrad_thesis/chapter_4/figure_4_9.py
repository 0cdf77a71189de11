"""Figure 4.9: the time that undirected exploration takes to the reward at the end of a chain."""

from collections.abc import Iterator
from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.schema import count
from motorgrad.statistics import Measured, mean_of
from motorgrad.worlds import FiniteMDP, chain
from motorgrad_thesis._claims import Claim, at_least, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment, smoke
from motorgrad_thesis._figures import Axes, Figure, draw_intervals, subplots

DRAWN = 6  # states in the thesis's drawing
CLOSE = 0.1  # the whole interval must lie within this relative distance of the expected wait
# effect of a wrong move: (variant of the chain, whether episodes are cut after N − 1 decisions, mean wait)
EXPLORERS = {
    "walk": ("walk", False, lambda n: n * (n - 1)),
    "reset": ("reset", False, lambda n: 2**n - 2),
    "cut": ("walk", True, lambda n: (n - 1) * 2 ** (n - 1)),
}
CHAIN_LABELS = {
    "walk": "one state back: $N(N-1)$",
    "reset": "back to the start: $2^N - 2$",
    "cut": "one state back, episodes of $N-1$: $(N-1)\\,2^{N-1}$",
}


@experiment("fig-4.9", "waiting for a first reward", "figure 4.9")
class ChainExploration(Experiment):
    """The number of steps that random actions take to the reward at the end of a chain of states. If a wrong move leads
    one state back, it grows quadratically; it grows exponentially if a wrong move leads back to the start, or if
    episodes are no longer than the shortest path.
    """

    reading: ClassVar[str] = (
        "The thesis both draws a chain whose actions lead one state to the left or right and says that enough "
        "steps to the right must be taken in a row. Its statement is judged for the chain as drawn; a wrong "
        "move that leads back to the start, and episodes as long as the shortest path, are reported beside "
        "it."
    )

    longest: int = count(12, DRAWN, 20, unit="states", help="length of the longest chain")
    runs: int = count(4000, 2, 10**6, help="number of walks over which each wait is averaged")
    seed: int = count(0, help="seed of the walks")

    quick = smoke(longest=DRAWN, runs=200)

    def run(self, work: Workspace) -> Values:
        lengths = range(2, self.longest + 1)
        found: Values = {"length": np.array(lengths)}
        for name, (variant, cut, _) in EXPLORERS.items():
            kept = work.part(name, lambda v=variant, c=cut: {"waits": [self._waits(n, v, c) for n in lengths]})
            found[name] = kept["waits"]
        return found

    def _waits(self, length: int, variant: str, cut: bool) -> np.ndarray:
        return first_reward_times(chain(length, variant), self.runs, self.seed, length - 1 if cut else None)

    def figure(self, values: Values) -> Figure:
        figure, (drawing, axes) = subplots(7, 5.6, 2, 1, height_ratios=[1, 3.2])
        _chain(drawing)
        length = values["length"]
        for colour, (name, (_, _, formula)) in zip(("C0", "C1", "C2"), EXPLORERS.items(), strict=True):
            axes.plot(length, [formula(int(n)) for n in length], color=colour, linewidth=1, alpha=0.6)
            means = [mean_of(waits) for waits in values[name]]
            draw_intervals(axes, length, means, fmt="o", markersize=4, color=colour, label=CHAIN_LABELS[name])
        axes.set(yscale="log", xlabel="states $N$", ylabel="steps until the first reward")
        axes.set_title(
            f"points: mean of {values['walk'].shape[1]:,} walks, 95 % interval; lines: exact", fontsize=9, color="0.4"
        )
        axes.legend(title="a wrong move leads", loc="upper left")
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        row = int(np.flatnonzero(values["length"] == DRAWN)[0])
        for name, statement in (
            ("walk", "A walk that moves left or right takes N(N − 1) steps to the reward, here 30"),
            ("reset", "If a wrong move leads back to the start, it takes 2^N − 2 steps, here 62"),
            ("cut", "In episodes of N − 1 decisions, it takes (N − 1) 2^(N − 1) steps, here 160"),
        ):
            expected = EXPLORERS[name][2](DRAWN)
            waits = mean_of(values[name][row])
            yield within(
                expected * (1 - CLOSE), expected * (1 + CLOSE), f"{statement}.", waits, unit="steps", kind="extension"
            )
        for name, words in (("walk", "as drawn"), ("reset", "if a wrong move leads back to the start")):
            yield at_least(
                0.9,
                f"Undirected exploration takes exponentially many steps ({words}).",
                doublings(values[name]),
                unit="doublings with the last state",
                note="" if name == "reset" else "The wait of the chain as drawn grows quadratically.",
                kind="thesis" if name == "walk" else "extension",
            )


def doublings(waits: np.ndarray) -> Measured:
    """The number of doublings of the mean wait with the last state. `(lengths, runs)` waits are split into ten groups
    for the interval."""
    groups = np.array_split(waits, min(10, waits.shape[1] // 2), axis=1)
    return mean_of([np.log2(group[-1].mean() / group[-2].mean()) for group in groups])


def first_reward_times(mdp: FiniteMDP, runs: int, seed: int, limit: int | None = None) -> np.ndarray:
    """Steps to the first positive reward under uniformly random actions from the start, `(runs,)`.

    **Arguments:** the MDP; the number of walks; `seed`; `limit`, decisions after which an episode is cut and restarted.
    """
    move = jax.vmap(mdp.step)
    pay = jax.vmap(mdp.reward)
    start = jnp.full(runs, mdp.start, jnp.int32)

    def going(carry: tuple) -> jax.Array:
        return jnp.any(carry[1] == 0)

    def step(carry: tuple) -> tuple:
        state, waited, now, key = carry
        key, own = jax.random.split(key)
        drawn = jax.random.uniform(own, (runs, 2))
        action = jnp.minimum((drawn[:, 0] * mdp.actions).astype(jnp.int32), mdp.actions - 1)
        after = move(state, action, drawn[:, 1:])
        now += 1
        waited = jnp.where((waited == 0) & (pay(state, action, after) > 0), now, waited)
        over = False if limit is None else now % limit == 0
        return jnp.where(over, start, after), waited, now, key

    begin = (start, jnp.zeros(runs, jnp.int32), jnp.int32(0), jax.random.key(seed))
    return np.asarray(jax.jit(lambda: jax.lax.while_loop(going, step, begin)[1])())


def _chain(axes: Axes) -> None:
    """The chain as the thesis draws it."""
    from matplotlib.patches import Circle, FancyArrowPatch

    for state in range(DRAWN):
        last = state == DRAWN - 1
        axes.add_patch(Circle((state, 0), 0.22, facecolor="#2e8b5733" if last else "white", edgecolor="0.3"))
        axes.text(state, 0, "r = 1" if last else "", ha="center", va="center", fontsize=8)
        if not last:
            # from the rewarded state, either action leads back to the start
            for way, colour in ((1, "C2"), (-1, "0.55"))[: 1 if state == DRAWN - 2 else 2]:
                ends = ((state + 0.5 - way * 0.26, 0.1 * way), (state + 0.5 + way * 0.26, 0.1 * way))
                bend = f"arc3,rad={-0.35}"
                axes.add_patch(
                    FancyArrowPatch(*ends, connectionstyle=bend, arrowstyle="-|>", mutation_scale=10, color=colour)
                )
    axes.text(0, -0.42, "start", ha="center", fontsize=9, color="0.4")
    axes.set(xlim=(-0.6, DRAWN - 0.4), ylim=(-0.55, 0.45), aspect="equal")
    axes.set_axis_off()
