"""Figure 6.1: a global and a local unit."""

from collections.abc import Iterator
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from motorgrad.policies import Hyperplanes, LocalGaussians, Policy
from motorgrad.statistics import exact
from motorgrad_thesis._claims import Claim, below, within
from motorgrad_thesis._experiment import Experiment, Values, Workspace, experiment
from motorgrad_thesis._figures import Figure, new_figure

CELLS = 81
REACH = 3.0  # range of the inputs drawn, to either side
FAR = 1_000.0  # distance from the origin, in units of the inputs
LEVEL = 0.01


@experiment("fig-6.1", "global and local approximators", "figure 6.1")
class Approximators(Experiment):
    """Firing probability of a hyperplane unit and of a Gaussian unit over two inputs: the one divides the whole plane
    in two, the other acts in one place."""

    def run(self, work: Workspace) -> Values:
        del work
        side = np.linspace(-REACH, REACH, CELLS)
        turn = np.linspace(0, 2 * np.pi, 720, endpoint=False)
        plane = np.stack(np.meshgrid(side, side), axis=-1)
        circle = FAR * np.stack([np.cos(turn), np.sin(turn)], axis=-1)
        found: Values = {"side": side}
        for name, unit in _units().items():
            found[name] = _fires(unit, plane)
            found[f"{name} far"] = _fires(unit, circle)
        return found

    def figure(self, values: Values) -> Figure:
        figure = new_figure(9, 4.4)
        x, y = np.meshgrid(values["side"], values["side"])
        titles = {"global": "global: a hyperplane", "local": "local: an axis-aligned Gaussian"}
        for column, (name, title) in enumerate(titles.items(), 1):
            axes: Any = figure.add_subplot(1, 2, column, projection="3d")
            axes.plot_surface(x, y, values[name], cmap="viridis", vmin=0, vmax=1, rcount=60, ccount=60, linewidth=0)
            axes.contour(x, y, values[name], levels=[0.1, 0.5, 0.9], zdir="z", offset=-0.5, cmap="viridis")
            axes.set(zlim=(-0.5, 1), xticks=(-2, 0, 2), yticks=(-2, 0, 2), zticks=(0, 0.5, 1))
            axes.set(xlabel="$y_1$", ylabel="$y_2$", title=title)
            axes.title.set_fontsize(10)
            axes.view_init(elev=26, azim=-58)
            axes.set_box_aspect((1, 1, 0.7), zoom=0.95)
        figure.suptitle("probability of firing", fontsize=11)
        return figure

    def claims(self, values: Values) -> Iterator[Claim]:
        half = float((values["global far"] > 0.5).mean())
        away = float(values["local far"].max())
        yield within(
            0.49,
            0.51,
            "A global unit responds at any distance from what it has seen.",
            exact(half),
            f"share of directions in which it fires with more than one half at a distance of {FAR:g},",
            source="section 6.1",
        )
        yield below(
            LEVEL,
            "A local unit responds only in a neighbourhood.",
            exact(away),
            f"greatest firing probability at a distance of {FAR:g}",
            source="section 6.1",
        )


def _units() -> dict[str, Policy]:
    return {
        "global": Hyperplanes([[2.0, 1.2]], [0.4]),
        "local": LocalGaussians([[0.4, -0.3]], jnp.log(jnp.array([[0.7, 1.1]]))),
    }


def _fires(unit: Policy, places: np.ndarray) -> np.ndarray:
    flat = jnp.asarray(places.reshape(-1, 2), jnp.float32)
    return np.asarray(jax.vmap(unit.prob)(flat))[:, 0].reshape(places.shape[:-1])
