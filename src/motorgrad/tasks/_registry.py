"""The tasks by name. A new task is one new file and one line here."""

from typing import Any

from motorgrad._errors import unknown
from motorgrad._settings import build
from motorgrad.tasks._arm_recruitment import ArmRecruitment
from motorgrad.tasks._finite import CallAdmission, Chain, ThreeState
from motorgrad.tasks._gymnasium import Gymnasium
from motorgrad.tasks._hexapod import Hexapod, HexapodSynergy
from motorgrad.tasks._hexapod_primitive import HexapodPrimitive
from motorgrad.tasks._hexapod_stride import HexapodStride
from motorgrad.tasks._hopper import Hopper
from motorgrad.tasks._linear_recruitment import LinearRecruitment
from motorgrad.tasks._particle import FallingParticle
from motorgrad.tasks._particle_navigation import ParticleNavigation
from motorgrad.tasks._particle_orbit import ParticleOrbit
from motorgrad.tasks._task import Task

TASKS: dict[str, type[Task]] = {
    task.name: task
    for task in (
        ArmRecruitment,
        CallAdmission,
        Chain,
        FallingParticle,
        Gymnasium,
        Hexapod,
        HexapodPrimitive,
        HexapodStride,
        HexapodSynergy,
        Hopper,
        LinearRecruitment,
        ParticleNavigation,
        ParticleOrbit,
        ThreeState,
    )
}
"""The class of every task, by name; a task of your own may be added."""


def make(name: str, **settings: Any) -> Task:
    """The task called `name` with these settings changed from their defaults.

    A body's settings are given as a table: `make("hopper", penalty=0.2, body={"load_mass": 3.0})`.

    **Raises:** `ValueError` for an unknown name or setting, with the nearest known one, and for impossible values.
    """
    if name not in TASKS:
        raise unknown("task", name, TASKS)
    return build(TASKS[name], settings, name)
