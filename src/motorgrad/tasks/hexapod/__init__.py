"""Walking tasks on the hexapod: with muscles or synergies, in steps, and by a clock on slopes."""

from motorgrad.tasks.hexapod._hexapod import Hexapod, HexapodMemory, HexapodSynergy
from motorgrad.tasks.hexapod._primitive import HexapodPrimitive, PrimitiveMemory
from motorgrad.tasks.hexapod._stride import HexapodStride, StrideMemory
from motorgrad.tasks.hexapod._synergies import Synergies, find_synergies, synergy_matrix
from motorgrad.tasks.hexapod._walking import TRIPOD_SYNERGIES

__all__ = [
    "TRIPOD_SYNERGIES",
    "Hexapod",
    "HexapodMemory",
    "HexapodPrimitive",
    "HexapodStride",
    "HexapodSynergy",
    "PrimitiveMemory",
    "StrideMemory",
    "Synergies",
    "find_synergies",
    "synergy_matrix",
]
