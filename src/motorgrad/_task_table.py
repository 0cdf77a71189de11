"""The table of tasks: a new task is one file, and one line here, from which `import motorgrad` registers it as a
Gymnasium environment before any task is loaded. Importing this module loads no task."""

from typing import NamedTuple


class Entry(NamedTuple):
    """The `place` of a task, module and class below `motorgrad.tasks`, and its id as a Gymnasium environment, if it is
    one."""

    place: str
    env_id: str | None = None


TASK_TABLE = {
    "arm-recruitment": Entry("_arm_recruitment:ArmRecruitment", "motorgrad/ArmRecruitment-v0"),
    "call-admission": Entry("_finite:CallAdmission", "motorgrad/CallAdmission-v0"),
    "chain": Entry("_finite:Chain", "motorgrad/Chain-v0"),
    "particle": Entry("_particle:FallingParticle", "motorgrad/Particle-v0"),
    "composed": Entry("_composed:Composed", "motorgrad/Composed-v0"),
    "gymnasium": Entry("gymnasium._gymnasium:Gymnasium"),
    "hexapod": Entry("hexapod._hexapod:Hexapod", "motorgrad/Hexapod-v0"),
    "hexapod-primitive": Entry("hexapod._primitive:HexapodPrimitive", "motorgrad/HexapodPrimitive-v0"),
    "hexapod-proprioception": Entry("hexapod._hexapod:HexapodProprioception", "motorgrad/HexapodProprioception-v0"),
    "hexapod-stride": Entry("hexapod._stride:HexapodStride", "motorgrad/HexapodStride-v0"),
    "hexapod-synergy": Entry("hexapod._hexapod:HexapodSynergy", "motorgrad/HexapodSynergy-v0"),
    "hopper": Entry("_hopper:Hopper", "motorgrad/Hopper-v0"),
    "linear-recruitment": Entry("_recruitment:LinearRecruitment", "motorgrad/LinearRecruitment-v0"),
    "load-unload": Entry("_finite:LoadUnload", "motorgrad/LoadUnload-v0"),
    "parity": Entry("_finite:Parity", "motorgrad/Parity-v0"),
    "particle-navigation": Entry("_particle:ParticleNavigation", "motorgrad/ParticleNavigation-v0"),
    "particle-orbit": Entry("_particle:ParticleOrbit", "motorgrad/ParticleOrbit-v0"),
    "t-maze": Entry("_finite:TMaze", "motorgrad/TMaze-v0"),
    "three-state": Entry("_finite:ThreeState", "motorgrad/ThreeState-v0"),
}
