"""Replays: recorded motions as one HTML file that plays anywhere, without a server and without the network."""

from timsim.film import Plot
from timsim.replay._replay import MAX_REPLAY_BYTES, Replay, write_replay

__all__ = ["MAX_REPLAY_BYTES", "Plot", "Replay", "write_replay"]
