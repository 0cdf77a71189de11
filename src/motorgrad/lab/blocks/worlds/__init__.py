"""What there is to move: tasks over worlds and bodies, MuJoCo models, muscles, Gymnasium environments."""

from motorgrad.lab._block import Block
from motorgrad.lab.blocks.worlds._body import Body, Environment
from motorgrad.lab.blocks.worlds._mujoco import MujocoModel
from motorgrad.lab.blocks.worlds._muscle import MuscleLaw
from motorgrad.lab.blocks.worlds._world import World

BLOCKS: tuple[type[Block], ...] = (Body, Environment, MujocoModel, MuscleLaw, World)
"""The types of blocks that move."""
