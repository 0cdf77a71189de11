"""Every figure of the documentation by the name of its file."""

from collections.abc import Callable

from matplotlib.figure import Figure

from timsim import Motion
from tools.figures import (
    bodies,
    composed,
    credit,
    critics,
    estimators,
    family,
    films,
    foreign,
    further,
    growth,
    hexapod,
    hexapod_steps,
    hexapod_tasks,
    hopper,
    memory,
    myosuite,
    networks,
    particle,
    parts,
    recruitment,
    searches,
    spikes,
    streaming,
    tasks,
    tendons,
    units,
)
from tools.figures._work import Work

DRAWN: dict[str, Callable[[], Figure]] = {
    "unit-motoneuron": units.motoneuron,
    "unit-graded": units.graded,
    "unit-hyperplane": units.hyperplane,
    "unit-gaussian-local": units.gaussian_local,
    "unit-gaussian-free": units.gaussian_free,
    "unit-soft-sphere": units.soft_sphere,
    "unit-soft-box": units.soft_box,
    "unit-masked": units.masked,
    "unit-gated": units.gated,
    "unit-mirrored": units.mirrored,
    "unit-softmax": units.softmax,
    "unit-factored": units.factored,
    "unit-querying": units.querying,
    "unit-bounded": units.bounded,
    "unit-autoregressive": memory.autoregressive,
    "unit-spiking": spikes.spiking,
    "unit-features": units.features,
    "unit-network": networks.network,
    "unit-primitives": hexapod_steps.primitives_policy,
    "batch-methods": family.clipping,
    "streaming": family.bounded_steps,
    "streaming-bodies": streaming.bodies,
    "streaming-gymnasium": streaming.gymnasium,
    "growth": growth.schedule,
    "muscle": bodies.muscle,
    "hill-curves": tendons.curves,
    "hill-experiments": tendons.experiments,
    "body-hopper": bodies.hopper,
    "body-hexapod": hexapod.body,
    "body-mjcf": composed.arm,
    "hexapod-muscles": hexapod.muscles,
    "hexapod-controller": hexapod.controller,
    "terrain": hexapod.terrain,
    "task-hexapod": hexapod_tasks.task,
    "task-hexapod-synergy": hexapod_tasks.synergies,
    "task-hexapod-stride": hexapod_steps.stride,
    "task-hexapod-primitive": hexapod_steps.primitive,
    "task-three-state": tasks.three_state,
    "task-chain": tasks.chain,
    "task-call-admission": tasks.call_admission,
    "task-load-unload": memory.load_unload,
    "task-t-maze": memory.t_maze,
    "task-linear-recruitment": recruitment.mapping,
    "task-particle": particle.layouts,
    "task-particle-orbit": particle.orbit,
    "task-particle-navigation": particle.navigation,
    "myosuite": myosuite.learning,
    "hindsight": myosuite.hindsight,
    "action-values": further.action_values,
    "discounting": credit.discounting,
}
"""Figures of formulas and numbers."""

MEASURED: dict[str, Callable[[Work], Figure]] = {
    "estimator-olgarb": estimators.olgarb_figure,
    "estimator-olpomdp": estimators.olpomdp_figure,
    "estimator-gpomdp": estimators.gpomdp_figure,
    "traces": parts.traces,
    "baselines": parts.baselines,
    "ascent": parts.ascent,
    "critics": critics.critics,
    "true-online": critics.true_online,
    "policy-search": searches.policies,
    "bayesian-search": searches.bayesian,
    "batch-learning": family.batches,
    "actor-critic": family.actor_critics,
    "reward-centring": family.centring,
    "optimal-baselines": family.optimal_baselines,
    "swift-td": family.swift,
    "intentional": further.intentional,
    "conjugate-ascent": family.ascent,
    "action-transitions": credit.action_transitions,
    "learned-trace": credit.learned_trace,
    "stationary-metric": credit.stationary_metric,
    "natural-actor-critics": credit.natural_actor_critics,
    "holding": myosuite.holding,
    "learning-three-state": tasks.three_state_learning,
    "learning-chain": tasks.chain_learning,
    "learning-call-admission": tasks.call_admission_learning,
    "unit-layered": memory.layered,
    "unit-controller": memory.controller,
    "unit-recurrent": memory.recurrent,
    "learning-parity": memory.parity,
    "learning-load-unload": memory.load_unload_learning,
    "learning-t-maze": memory.t_maze_learning,
    "learning-arm-recruitment": recruitment.arm_learning,
    "learning-particle": particle.falling_learning,
    "film-particle": particle.film,
    "learning-particle-orbit": particle.orbit_learning,
    "learning-particle-navigation": particle.navigation_learning,
    "foreign-learning": foreign.learning,
    "task-composed": composed.learning,
    "rollout": composed.forces,
    "foreign-natural": foreign.preset,
    "task-hopper": hopper.task,
    "hopper-learning": hopper.learning,
    "hopper-behaviour": hopper.behaviour,
}
"""Figures for which something has to learn first, or to be estimated."""

FILMS: dict[str, Callable[[Work], list[Motion]]] = {
    "hexapod-learns-to-walk": films.hexapod_walk,
    "hexapod-walks-with-four-units": films.hexapod_synergies,
    "hopper-learns-to-hop": films.hopper_hop,
    "arm-learns-to-reach": films.arm_reach,
}
"""Films of bodies that learn, as animated WebP: the motions that they show side by side."""

REPLAYS = ("hexapod-learns-to-walk", "hopper-learns-to-hop", "arm-learns-to-reach")
"""Films that are pages, too, on which the viewer moves clock and camera."""

FIGURE_NAMES = (*DRAWN, *MEASURED, *FILMS)


def made(name: str, work: Work) -> Figure:
    """The figure of that name, where it is no film."""
    return DRAWN[name]() if name in DRAWN else MEASURED[name](work)
