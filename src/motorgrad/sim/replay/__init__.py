"""Replays: recorded motions as one HTML file that plays anywhere, without a server and without the network."""

from motorgrad.sim.film import Plot
from motorgrad.sim.replay._replay import LARGEST, Replay, write_replay

__all__ = ["LARGEST", "Plot", "Replay", "write_replay"]
