"""All experiments by name, in the order of the source."""

from importlib import import_module

from motorgrad_thesis._experiment import Experiment

MODULES = (
    "chapter_2.figure_2_1",
    "chapter_2.section_2_4",
    "chapter_2.figure_2_2",
    "chapter_2.section_2_5_1",
    "chapter_3.section_3_1_newton",
    "chapter_3.figure_3_1",
    "chapter_3.section_3_2_1",
    "chapter_3.section_3_2_1_criteria",
    "chapter_3.section_3_2_2_accurate",
    "chapter_4.figure_4_1",
    "chapter_4.section_4_1_3_spiking",
    "chapter_4.figure_4_2",
    "chapter_4.figure_4_3",
    "chapter_4.figure_4_4",
    "chapter_4.figure_4_5",
    "chapter_4.figure_4_6",
    "chapter_4.figure_4_7",
    "chapter_4.figure_4_8",
    "chapter_4.figure_4_9",
    "chapter_4.section_4_4.updates",
    "chapter_4.section_4_4.negative_inputs",
    "chapter_4.section_4_4.large_loads",
    "chapter_4.section_4_4.asynchronous",
    "chapter_4.section_4_4.growth",
    "chapter_4.section_4_4.figure_4_10",
    "chapter_4.section_4_4.tied_units",
    "chapter_4.section_4_4.forgetting_baseline",
    "chapter_4.section_4_4.learned_step",
    "chapter_4.section_4_4.gain_decay",
    "chapter_4.section_4_4.active_learning",
    "chapter_4.section_4_4.rate_modulation",
    "chapter_4.section_4_4.size_principle",
    "chapter_4.beyond_4_3_1_pools",
    "chapter_5.figure_5_1",
    "chapter_5.section_5_1_3_motors",
    "chapter_5.figure_5_2",
    "chapter_5.section_5_2_penalty",
    "chapter_5.figure_5_3",
    "chapter_5.figure_5_4",
    "chapter_5.figure_5_5",
    "chapter_5.section_5_2_2",
    "chapter_5.hexapod.figure_5_6",
    "chapter_5.hexapod.figure_5_7",
    "chapter_5.hexapod.section_5_3_3_terrain",
    "chapter_5.extensions.section_5_3_3_morphology",
    "chapter_5.extensions.section_5_3_3_forces",
    "chapter_5.hexapod.figure_5_8",
    "chapter_5.hexapod.section_5_3_4_gaits",
    "chapter_5.hexapod.section_5_3_4_episodes",
    "chapter_5.hexapod.section_5_3_4_olgarb",
    "chapter_5.extensions.beyond_5_3_4_muscles",
    "chapter_5.extensions.beyond_5_3_4_proprioception",
    "chapter_5.extensions.section_5_4_1_primitive",
    "chapter_5.extensions.beyond_5_4_1_synergies",
    "chapter_5.hexapod.figure_5_9",
    "chapter_5.extensions.section_5_4_1_biomimetic",
    "chapter_5.extensions.section_5_4_1_stride",
    "chapter_6.figure_6_1",
    "chapter_6.section_6_1_1_forgetting",
    "chapter_6.figure_6_2",
    "chapter_6.beyond_6_2_natural",
    "chapter_6.section_6_2_3_srv",
    "chapter_6.figure_6_3",
    "chapter_6.section_6_3_noise",
    "chapter_6.figure_6_4",
    "chapter_6.figure_6_5",
    "chapter_6.figure_6_6",
    "chapter_6.section_6_4.section_6_4_criteria",
    "chapter_6.section_6_4.section_6_4_placement",
    "chapter_6.section_6_4.figure_6_7",
    "chapter_6.section_6_4.figure_6_8",
    "chapter_6.section_6_4.figure_6_9",
    "chapter_6.section_6_5.mixtures",
    "chapter_6.section_6_5.pruning",
    "chapter_6.section_6_5.hierarchy",
    "chapter_6.section_6_5.navigation",
    "chapter_6.section_6_5.spatial_index",
    "chapter_6.section_6_5.local_hopper",
    "chapter_7.section_7_3_models",
    "chapter_7.section_7_3_bayesian_monte_carlo",
    "chapter_7.section_7_3_forgetting",
    "appendix_a.figure_a_1",
    "appendix_a.figure_a_2",
    "appendix_a.section_a_3",
)
"""A new experiment is one file, which holds one experiment, and a line in this table."""


def _experiment_in(path: str) -> type[Experiment]:
    module = import_module(f"motorgrad_thesis.{path}")
    own = [each for each in vars(module).values() if getattr(each, "__module__", "") == module.__name__]
    (kind,) = (each for each in own if isinstance(each, type) and issubclass(each, Experiment))
    return kind


EXPERIMENTS: dict[str, type[Experiment]] = {kind.name: kind for kind in map(_experiment_in, MODULES)}
"""All experiments by name."""
