"""Figure 4.7: the reward of the arm, and the best activation."""

from collections.abc import Iterator

import jax.numpy as jnp
import numpy as np

from motorgrad.bodies import Posture
from motorgrad.schema import count
from motorgrad.statistics import exact
from motorgrad.tasks import ArmRecruitment
from motorgrad_thesis._claims import Claim, at_least, at_most, within
from motorgrad_thesis._experiment import Values, Workspace, experiment
from motorgrad_thesis._figures import SubFigure
from motorgrad_thesis.chapter_4._postures import BothPostures, arm_task

CLOSE = 0.02  # fraction of the full activation


@experiment("fig-4.7", "the reward surface", "figure 4.7")
class RewardSurface(BothPostures):
    """The reward of every activation at every load (the height minus four times the activation), and the best
    activation at each load, with the upper arm held vertically and horizontally. The weakest activation that lifts the
    load to the top is best: below it the height falls steeply, above it only the cost rises.
    """

    loads: int = count(321, 11, 10_001, help="number of grid points over the loads")
    activations: int = count(1001, 11, 10_001, help="number of grid points over the activations")

    size = (7, 4.6)

    def measure(self, work: Workspace, posture: Posture) -> Values:
        task = arm_task(posture)
        loads = np.linspace(task.low, task.high, self.loads)
        active = np.linspace(0, 1, self.activations)
        reward = rewards(task, loads, active)
        return {"load": loads, "activation": active, "reward": reward, "best": active[reward.argmax(0)]}

    def draw(self, figure: SubFigure, values: Values, posture: Posture) -> None:
        axes = figure.subplots()
        load = values["load"]
        active = values["activation"]
        mesh = axes.pcolormesh(load, active, values["reward"], cmap="viridis", shading="nearest", rasterized=True)
        some = load > 0
        axes.contour(load[some], active, values["reward"][:, some], range(0, 10, 2), colors="white", linewidths=0.5)
        axes.plot(load, values["best"], color="white", linewidth=3.5)
        axes.plot(load, values["best"], color="#c0392b", linewidth=1.8, label="best activation")
        axes.set(xlabel="load (kg); none below 0", ylabel="activation", ylim=(0, 1))
        axes.legend(loc="lower right", labelcolor="white")
        figure.colorbar(mesh, ax=axes, label="reward", pad=0.01)

    def judge(self, values: Values, posture: Posture) -> Iterator[Claim]:
        load = values["load"]
        best = values["best"]
        idle = best[load <= 0].max()
        full = best[-1]
        falls = float(np.diff(best).min())
        yield at_most(
            0,
            "Without a load, it is best to activate nothing.",
            exact(idle),
            "greatest of the best activations",
            source="section 4.3.2",
        )
        yield within(
            1 - CLOSE,
            1 + CLOSE,
            "The best activation rises to 1 at the heaviest load.",
            exact(full),
            unit=f"at {load[-1]:g} kg",
            note="We chose the muscle's strength accordingly.",
        )
        yield at_least(
            0, "The best activation never falls with the load.", exact(falls), "least rise from each load to the next"
        )


def rewards(task: ArmRecruitment, loads: np.ndarray, activations: np.ndarray) -> np.ndarray:
    """The reward of every activation at every load, `(activations, loads)`."""
    ratio = jnp.asarray(activations)[:, None]
    load = jnp.asarray(loads)[None]
    return np.asarray(task.pay(load, ratio, task.effect(load, ratio)), float)
