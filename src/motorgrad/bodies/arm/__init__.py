"""An arm that lifts loads, and the table of how high it lifts them."""

from motorgrad.bodies.arm._arm import Arm
from motorgrad.bodies.arm._lift import STORED, LiftTable, greatest_flexion, lift, lift_table, tabulate_lift

__all__ = ["STORED", "Arm", "LiftTable", "greatest_flexion", "lift", "lift_table", "tabulate_lift"]
