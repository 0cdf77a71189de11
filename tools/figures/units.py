"""Figures of the units: probabilities of firing, and scores."""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from matplotlib.figure import Figure

from motorgrad.policies import (
    BoundedHyperplanes,
    Factored,
    FeatureMap,
    FreeGaussians,
    Gated,
    GradedMotoneurons,
    Hyperplanes,
    LocalGaussians,
    Masked,
    Mirrored,
    Motoneurons,
    Querying,
    SoftBoxes,
    Softmax,
    SoftSpheres,
    abilities,
)
from tools.figures._style import BLUE, COLOURS, FAINT, GREEN, ORANGE, RED, arrow, inputs, over, panels, plane

FIRES = 1.0
SILENT = 0.0


def motoneuron() -> Figure:
    """p(fire) over the input for several gains, and both scores."""
    gains = (-4.0, 1.0, 4.0, 12.0)
    pool = Motoneurons(jnp.full(len(gains), 0.5), jnp.array(gains))
    y = np.linspace(-0.5, 1.5, 201)
    figure, (fire, threshold, gain) = panels(3)
    scores = {a: over(lambda point, a=a: pool.score(point, jnp.full(len(gains), a)), y) for a in (FIRES, SILENT)}
    probability = over(pool.prob, y)
    for unit, (k, colour) in enumerate(zip(gains, (ORANGE, GREEN, BLUE, RED), strict=True)):
        fire.plot(y, probability[:, unit], color=colour, label=f"$k$ = ${k:g}$")
        for action, line in ((FIRES, "-"), (SILENT, "--")):
            threshold.plot(y, scores[action].threshold[:, unit], line, color=colour)
            gain.plot(y, scores[action].gain[:, unit], line, color=colour)
    fire.axvline(0.5, color=FAINT, linewidth=0.8, linestyle=":")
    fire.set(title="probability of firing, $y^*$ = 0.5", xlabel="input $y$", ylim=(-0.03, 1.03))
    threshold.set(title=r"score of the threshold, $\partial_{y^*}$", xlabel="input $y$")
    gain.set(title=r"score of the gain, $\partial_k$", xlabel="input $y$")
    fire.plot([], [], "-", color=FAINT, label="score when it fired")
    fire.plot([], [], "--", color=FAINT, label="when it did not")
    figure.legend(loc="outside lower center", ncols=6)
    return figure


def graded() -> Figure:
    """Mean activations with their noise, and scores over the activation drawn."""
    y = np.linspace(-0.2, 1.2, 201)
    figure, (active, gain, deviation) = panels(3)
    for k, s, colour in ((4.0, 0.2, GREEN), (12.0, 0.1, BLUE), (-6.0, 0.05, ORANGE)):
        pool = GradedMotoneurons(threshold=[0.5], gain=[k], log_deviation=np.log([s - 0.02]))
        mean = over(pool.mean, y)[:, 0]
        spread = float(pool.deviation[0])
        active.fill_between(y, mean - spread, mean + spread, color=colour, alpha=0.2, linewidth=0)
        active.plot(y, mean, color=colour, label=f"$k$ = ${k:g}$, $s$ = {s:g}")
    for level in (0, 1):
        active.axhline(level, color=FAINT, linewidth=0.8, linestyle=":")
    active.set(title="activation, $y^*$ = 0.5", xlabel="input $y$", ylim=(-0.3, 1.75))
    active.legend(loc="upper center", fontsize=7, ncols=1)
    drawn = np.linspace(-0.1, 1.3, 201)
    for s, colour in ((0.3, GREEN), (0.2, BLUE), (0.1, RED)):
        pool = GradedMotoneurons(threshold=[0.5], gain=[4.0], log_deviation=np.log([s - 0.02]))
        scores = over(lambda a, pool=pool: pool.score(jnp.array([0.6]), a), drawn)
        gain.plot(drawn, scores.gain[:, 0], color=colour, label=f"$s$ = {s:g}")
        deviation.plot(drawn, scores.log_deviation[:, 0], color=colour)
    for panel in (gain, deviation):
        panel.axvline(float(pool.mean(jnp.array([0.6]))[0]), color=FAINT, linewidth=0.8, linestyle=":")
    gain.set(title=r"score of the gain, $\partial_k$, at $y$ = 0.6", xlabel="activation drawn", ylim=(-0.8, 0.8))
    gain.legend(loc="upper left")
    deviation.set(title=r"score of the deviation, $\partial_\lambda$", xlabel="activation drawn", ylim=(-1.5, 6))
    return figure


def querying() -> Figure:
    """The entropy of a pool over the load, and how often each cell is asked for."""
    pool = Motoneurons([0.19, 0.4, 0.6, 0.81], [60.0, 25.0, 40.0, 15.0])
    y = np.linspace(0, 1, 401)
    figure, (fires, asked) = panels(2)
    probability = over(pool.prob, y)
    for unit in range(pool.outputs):
        fires.plot(y, probability[:, unit], color=BLUE, linewidth=1, label="" if unit else "each unit fires")
    entropy = over(lambda point: pool.entropy(point)[None], y)[:, 0]
    fires.plot(y, entropy, color=RED, label="entropy of the action, nats")
    fires.set(title="a pool of four units", xlabel="load", ylim=(0, 1.35))
    fires.legend(loc="upper left", ncols=2)
    for explore, colour in ((0.0, ORANGE), (0.1, RED), (1.0, FAINT)):
        policy = Querying(pool, explore=jnp.asarray(explore))
        density = policy.cells * np.asarray(policy.query_probabilities())
        edges = np.linspace(0, 1, policy.cells + 1)
        asked.stairs(density, edges, color=colour, label=rf"$\epsilon$ = {explore:g}")
    asked.set(title="density of the loads asked for", xlabel="load", ylim=(0, None))
    asked.legend(loc="upper right")
    return figure


def hyperplane() -> Figure:
    """p(fire) over two inputs with the boundary, and the score of the weights as arrows."""
    weights = np.array([1.5, -1.0])
    bias = 0.75
    unit = Hyperplanes(weights[None], jnp.array([bias]))
    x, y = plane(3.0)
    figure, axes = panels(3, height=2.9, sharey=True)
    shown = axes[0].pcolormesh(x, y, over(unit.prob, x, y)[..., 0], vmin=0, vmax=1, rasterized=True)
    figure.colorbar(shown, ax=axes[0], location="bottom", shrink=0.9, label=r"$\sigma(w \cdot y + b)$")
    inputs(axes[0], "probability of firing")
    points = plane(2.6, 9)
    for panel, action, title in ((axes[1], FIRES, "score when it fired"), (axes[2], SILENT, "score when it did not")):
        score = over(lambda point, a=action: unit.score(point, jnp.array([a])), *points).weights[..., 0, :]
        panel.quiver(*points, score[..., 0], score[..., 1], color=RED if action else BLUE, scale=22, width=0.008)
        inputs(panel, title)
        panel.set(ylabel="", xlim=(-3, 3))
    along = np.array([-3.0, 3.0])
    for panel in axes:
        panel.plot(along, -(bias + weights[0] * along) / weights[1], color="white" if panel is axes[0] else FAINT, lw=1)
        panel.set(ylim=(-3, 3))
    foot = -bias * weights / (weights @ weights)
    arrow(axes[0], foot, foot + weights, "white")
    axes[0].text(*(foot + weights * 0.95 + [-0.1, -0.55]), "$w$", color="black")
    return figure


def gaussian_local() -> Figure:
    """A unit over two inputs with the score of its centre; its height; the score of its width."""
    unit = LocalGaussians([[0.2, -0.1]], np.log([[0.7, 0.35]]), p_max=jnp.array(0.9))
    x, y = plane(1.5)
    figure, (place, height, width) = panels(3, height=3.0)
    shown = place.pcolormesh(x, y, over(unit.prob, x, y)[..., 0], vmin=0, vmax=1, rasterized=True)
    figure.colorbar(shown, ax=place, location="bottom", shrink=0.9, label="its probability of firing")
    points = plane(1.25, 6)
    score = over(lambda point: unit.score(point, jnp.ones(1)), *points).centre[..., 0, :]
    place.quiver(*points, score[..., 0], score[..., 1], color="white", scale=70, width=0.008)
    inputs(place, r"score of the centre when it fired")
    z = np.linspace(-1.5, 1.5, 301)
    for p_max, sigma, colour in ((1.0, 0.5, BLUE), (0.5, 0.5, RED), (0.5, 0.2, GREEN)):
        one = LocalGaussians([[0.0]], np.log([[sigma]]), p_max=jnp.array(p_max))
        height.plot(z, over(one.prob, z)[:, 0], color=colour, label=f"{p_max:g}, {sigma:g}")
        if sigma == 0.5:
            for action, line in ((FIRES, "-"), (SILENT, "--")):
                slope = over(lambda point, a=action, one=one: one.score(point, jnp.array([a])), z).log_width
                width.plot(z, slope[:, 0, 0], line, color=BLUE if p_max == 1 else RED)
    height.set(title="probability of firing", xlabel="input $y$", ylim=(0, 1.4))
    height.legend(title=r"$p_{max}$, $\sigma$", loc="upper center", fontsize=7, ncols=3, columnspacing=1)
    width.set(title=r"score of the width, $\partial_\lambda$", xlabel="input $y$", ylim=(-2.2, 4.2))
    width.plot([], [], "-", color=FAINT, label="it fired")
    width.plot([], [], "--", color=FAINT, label="it did not")
    width.legend(loc="upper center")
    return figure


def gaussian_free() -> Figure:
    """The same unit at several widths, and both kinds' score of the width."""
    z = np.linspace(-2.0, 2.0, 401)
    figure, (height, width) = panels(2)
    for sigma, colour in ((0.25, RED), (0.5, BLUE), (1.0, GREEN)):
        unit = FreeGaussians([[0.0]], np.log([[sigma]]), log_mass=[-0.25])
        height.plot(z, over(unit.prob, z)[:, 0], color=colour, label=rf"$\sigma$ = {sigma:g}")
    height.set(title=r"probability of firing, $\alpha$ = −0.25", xlabel="input $y$", ylim=(0, 1.1))
    height.legend()
    free = FreeGaussians([[0.0]], np.log([[0.5]]), log_mass=[-0.25])
    local = LocalGaussians([[0.0]], np.log([[0.5]]), p_max=free.prob(jnp.zeros(1))[0])
    for unit, colour, words in ((free, BLUE, r"free: $z^2 - 1$"), (local, ORANGE, r"local: $z^2$")):
        for action, line in ((FIRES, "-"), (SILENT, "--")):
            slope = over(lambda point, a=action, unit=unit: unit.score(point, jnp.array([a])), z).log_width[:, 0, 0]
            label = f"{words}, it {'fired' if action else 'did not'}"
            width.plot(z, slope, line, color=colour, label=label)
    width.set(title=r"score of the width, $\sigma$ = 0.5", xlabel="input $y$", ylim=(-2, 7))
    width.legend(fontsize=7, loc="upper center")
    return figure


def soft_sphere() -> Figure:
    """A sphere over two inputs with the score of its centre; across it for several hardnesses, and its scores."""
    return _soft(
        SoftSpheres([[0.2, -0.1]], np.log([0.7]), np.log([8.0])),
        lambda hard: SoftSpheres([[0.0]], np.log([0.7]), np.log([hard])),
        "log_radius",
        r"score of the radius, $\partial_{\log r}$",
    )


def soft_box() -> Figure:
    """A box over two inputs with the score of its centre; across it for several hardnesses, and its scores."""
    return _soft(
        SoftBoxes([[0.2, -0.1]], np.log([[0.9, 0.4]]), np.log([8.0])),
        lambda hard: SoftBoxes([[0.0]], np.log([[0.7]]), np.log([hard])),
        "log_width",
        r"score of the width, $\partial_{\log h}$",
    )


def _soft(unit: SoftSpheres | SoftBoxes, across: Any, size: str, title: str) -> Figure:
    x, y = plane(1.5)
    figure, (place, height, width) = panels(3, height=3.0)
    shown = place.pcolormesh(x, y, over(unit.prob, x, y)[..., 0], vmin=0, vmax=1, rasterized=True)
    figure.colorbar(shown, ax=place, location="bottom", shrink=0.9, label="its probability of firing")
    points = plane(1.25, 7)
    score = over(lambda point: unit.score(point, jnp.ones(1)), *points).centre[..., 0, :]
    place.quiver(*points, score[..., 0], score[..., 1], color="white", scale=90, width=0.008)
    inputs(place, "score of the centre when it fired")
    z = np.linspace(-1.5, 1.5, 301)
    for hard, colour in ((3.0, GREEN), (8.0, BLUE), (30.0, RED)):
        one = across(hard)
        height.plot(z, over(one.prob, z)[:, 0], color=colour, label=f"$k$ = {hard:g}")
        if hard == 8.0:
            for action, line in ((FIRES, "-"), (SILENT, "--")):
                slope = getattr(over(lambda point, a=action, one=one: one.score(point, jnp.array([a])), z), size)
                width.plot(z, slope.reshape(len(z)), line, color=colour)
    for panel in (height, width):
        for side in (-0.7, 0.7):
            panel.axvline(side, color=FAINT, linewidth=0.8, linestyle=":")
    height.set(title="probability of firing", xlabel="input $y$", ylim=(-0.03, 1.4))
    height.legend(loc="upper center", fontsize=7, ncols=3, columnspacing=1)
    width.set(title=title, xlabel="input $y$", ylim=(-6.5, 9))
    width.plot([], [], "-", color=FAINT, label="it fired")
    width.plot([], [], "--", color=FAINT, label="it did not")
    width.legend(loc="upper center", ncols=2)
    return figure


def masked() -> Figure:
    """The probability that some unit of a pool of six fires, with two, four and all of its units there."""
    centres = [[-0.8, 0.6], [0.5, -0.7], [0.9, 0.8], [-0.6, -0.9], [0.0, 0.2], [1.0, 0.0]]
    widths = [[0.3, 0.4], [0.5, 0.25], [0.3, 0.3], [0.4, 0.3], [0.25, 0.4], [0.3, 0.35]]
    pool = LocalGaussians(centres, np.log(widths), p_max=jnp.array(0.8))
    x, y = plane(1.5)
    figure, axes = panels(3, height=2.7, sharey=True)
    shown: Any = None
    for panel, count in zip(axes, (2, 4, 6), strict=True):
        there = Masked(pool, np.arange(6) < count)
        some = 1 - np.prod(1 - over(there.prob, x, y), axis=-1)
        shown = panel.pcolormesh(x, y, some, vmin=0, vmax=1, rasterized=True)
        for unit, centre in enumerate(np.asarray(pool.centre)):
            panel.plot(*centre, "o" if unit < count else "x", color="white" if unit < count else FAINT, markersize=4)
        panel.set(title=f"{count} of 6 units are there", aspect="equal", xlabel="input $y_1$")
    axes[0].set_ylabel("input $y_2$")
    figure.colorbar(shown, ax=axes, shrink=0.8, label="some unit fires")
    return figure


def gated() -> Figure:
    """A gate, a hyperplane beneath it, and the probabilities of the three actions that are possible."""
    gate = LocalGaussians([[0.1, 0.2]], np.log([[0.8, 0.5]]), p_max=jnp.array(0.95))
    policy = Gated(gate, [Hyperplanes([[5.0, 3.0]], [-0.5])])
    x, y = plane(1.5, 91)
    figure, axes = panels(3, height=2.8, sharey=True)
    shown: Any = None
    titles = ("gate silent, so the unit too", "gate open, unit silent", "gate open, unit fires")
    for panel, action, title in zip(axes, abilities.enumerate(policy), titles, strict=True):
        chance = np.exp(over(lambda point, a=action: policy.log_prob(point, a)[None], x, y)[..., 0])
        shown = panel.pcolormesh(x, y, chance, vmin=0, vmax=1, rasterized=True)
        panel.contour(x, y, over(gate.prob, x, y)[..., 0], [0.475], colors="white", linewidths=0.8)
        panel.contour(x, y, over(policy.branches[0].prob, x, y)[..., 0], [0.5], colors="white", linestyles="--",
                      linewidths=0.8)  # fmt: skip
        panel.set(title=title, aspect="equal", xlabel="input $y_1$")
    axes[0].set_ylabel("input $y_2$")
    figure.colorbar(shown, ax=axes, shrink=0.8, label="probability")
    return figure


def mirrored() -> Figure:
    """Two units and their copies: one where two inputs change places, one where an input turns its sign."""
    swap = Mirrored(Hyperplanes([[3.0, 1.0]], [-0.5]), (1, 0), (1, 1), (0,), (1,))
    gaussian = LocalGaussians([[0.4, 0.7]], np.log([[0.7, 0.35]]), p_max=jnp.array(0.95))
    turn = Mirrored(gaussian, (0, 1), (1, -1), (0,), (1,))
    x, y = plane(1.5, 91)
    figure, axes = panels(4, height=2.0)
    shown: Any = None
    names = (("left angle", "right angle"), ("speed", "yaw rate"))
    for number, panel in enumerate(axes):
        policy = (swap, turn)[number // 2]
        (across, up) = names[number // 2]
        shown = panel.pcolormesh(x, y, over(policy.prob, x, y)[..., number % 2], vmin=0, vmax=1, rasterized=True)
        panel.plot(*(([-1.5, 1.5], [-1.5, 1.5]) if number < 2 else ([-1.5, 1.5], [0, 0])), ":", color="white")
        panel.set(title=("unit, left output", "copy, right output")[number % 2], aspect="equal")
        panel.set(xlabel=across, ylabel=up if number % 2 == 0 else "")
    figure.colorbar(shown, ax=axes, shrink=0.8, label="probability of firing")
    return figure


def softmax() -> Figure:
    """Probabilities of three actions against a feature, and where the score moves them on the simplex."""
    policy = Softmax([[0.0, -1.5], [0.6, 0.0], [0.0, 1.5]])
    feature = np.linspace(-4, 4, 201)
    chances = over(policy.prob, np.ones_like(feature), feature)
    figure, (curves, simplex) = panels(2, height=2.9, width_ratios=[1.35, 1])
    for action in range(3):
        curves.plot(feature, chances[:, action], color=COLOURS[action], label=f"action {action}")
    curves.set(title="probability of each action", xlabel="feature $y_2$, where $y_1$ = 1", ylim=(0, 1))
    curves.legend()
    corners = np.array([[0.0, 0.0], [0.5, np.sqrt(0.75)], [1.0, 0.0]])
    simplex.fill(*corners.T, facecolor="0.96", edgecolor=FAINT)
    simplex.plot(*(chances @ corners).T, color=FAINT, linewidth=1)
    for value in (-1.6, -0.4, 0.8):
        seen = jnp.array([1.0, value])
        now = np.asarray(policy.prob(seen))
        for action in range(3):
            score = policy.score(seen, jnp.int32(action))
            moved = eqx.tree_at(lambda p: p.weights, policy, policy.weights + 0.35 * score.weights)
            arrow(simplex, now @ corners, np.asarray(moved.prob(seen)) @ corners, COLOURS[action])
        simplex.plot(*(now @ corners), "o", color="0.2", markersize=3)
    for action, (x, y) in enumerate(corners):
        simplex.text(x, y + (0.03 if action == 1 else -0.03), f"action {action}", ha="center",
                     va="bottom" if action == 1 else "top", color=COLOURS[action])  # fmt: skip
    simplex.set(title="where a step along the score leads", aspect="equal", ylim=(-0.12, 1.0))
    simplex.set_axis_off()
    return figure


def factored() -> Figure:
    """The four joint actions of a hyperplane and a Gaussian over two inputs."""
    policy = Factored(
        [Hyperplanes([[2.5, 0.0]], [0.0]), LocalGaussians([[0.3, 0.4]], np.log([[0.6, 0.6]]), p_max=jnp.array(0.9))]
    )
    x, y = plane(1.5, 91)
    figure, axes = panels(4, height=2.5, sharey=True)
    shown: Any = None
    for panel, action in zip(axes, abilities.enumerate(policy), strict=True):
        chance = np.exp(over(lambda point, a=action: policy.log_prob(point, a)[None], x, y)[..., 0])
        shown = panel.pcolormesh(x, y, chance, vmin=0, vmax=1, rasterized=True)
        panel.set(title=f"action ({int(action[0])}, {int(action[1])})", aspect="equal", xlabel="$y_1$")
        panel.axvline(0, color="white", linewidth=0.8)
        panel.contour(x, y, over(policy.pools[1].prob, x, y)[..., 0], [0.45], colors="white", linewidths=0.8)
    axes[0].set_ylabel("$y_2$")
    figure.colorbar(shown, ax=axes, shrink=0.75, label="probability")
    return figure


def bounded() -> Figure:
    """Densities of the activation in [0, 1] for several locations and spreads, of each kind."""
    kinds = ("squashed", "clipped", "truncated", "beta")
    figure, axes = panels(len(kinds), height=2.4, sharey=True)
    u = np.linspace(1e-3, 1 - 1e-3, 400, dtype=np.float32)
    for panel, kind in zip(axes, kinds, strict=True):
        for location, spread, colour in ((0.0, 0.3, GREEN), (0.0, 1.2, BLUE), (0.9, 0.3, ORANGE)):
            numbers: dict[str, Any] = {"weights": [[0.0]], "bias": [location], "log_deviation": [np.log(spread - 0.02)]}
            bounds: dict[str, Any] = {"low": 0.0, "high": 1.0}
            unit = BoundedHyperplanes(**numbers, **bounds, density=kind)
            inside = u if kind != "clipped" else u[1:-1]
            at = jnp.asarray(inside)[:, None]
            density = np.exp(np.asarray(jax.vmap(lambda a, unit=unit: unit.log_probs(jnp.zeros(1), a))(at)))
            panel.plot(inside, density, color=colour, label=f"$m$ = {location:g}, $s$ = {spread:g}")
            if kind == "clipped":  # the probabilities of the bounds themselves
                ends = np.array([[0.0], [1.0]], np.float32)
                mass = np.exp(np.asarray(jax.vmap(lambda a, unit=unit: unit.log_probs(jnp.zeros(1), a))(ends)))
                panel.plot(ends, 10 * mass, "o", color=colour, markersize=4, clip_on=False)
        panel.set(title=kind, xlabel="activation", xlim=(0, 1), ylim=(0, 4))
    axes[0].set_ylabel("density")
    axes[1].annotate(
        "dots: 10 × the probability\nof a bound",
        (0.5, 0.98),
        xycoords="axes fraction",
        ha="center",
        va="top",
        fontsize=7,
    )
    handles, words = axes[0].get_legend_handles_labels()
    figure.legend(handles, words, loc="outside lower center", ncols=3)
    return figure


def features() -> Figure:
    """A function of two inputs, and what is linear in each kind of features and nearest to it."""
    maps = {
        "inputs": FeatureMap(),
        "products": FeatureMap(squares=True, products=True),
        "16 tanh": FeatureMap(nonlinear=16, scale=1.5),
        "16 Fourier": FeatureMap(nonlinear=16, shape="fourier", scale=1.5),
        "16 radial": FeatureMap(nonlinear=16, shape="radial", scale=1.5),
    }
    x, y = plane(2.0, 81)
    wanted = np.sin(2 * x) * np.cos(y) + 0.5 * x * y
    figure, axes = panels(1 + len(maps), height=1.9, sharey=True)
    style = {"cmap": "RdBu_r", "vmin": -2, "vmax": 2, "rasterized": True}
    axes[0].pcolormesh(x, y, wanted, **style)
    axes[0].set(title="wanted", ylabel="$y_2$")
    for panel, (name, features) in zip(axes[1:], maps.items(), strict=True):
        seen = over(features.expanded, x, y).reshape(wanted.size, -1)
        seen = np.concatenate([seen, np.ones((wanted.size, 1))], axis=1)
        weights = np.linalg.solve(seen.T @ seen + 1e-3 * np.eye(seen.shape[1]), seen.T @ wanted.ravel())
        found = (seen @ weights).reshape(wanted.shape)
        panel.pcolormesh(x, y, found, **style)
        panel.set(title=f"{name}\n{1 - np.var(wanted - found) / np.var(wanted):.0%} explained")
    for panel in axes:
        panel.set(xlabel="$y_1$", aspect="equal", xticks=(-2, 0, 2), yticks=(-2, 0, 2))
    return figure
