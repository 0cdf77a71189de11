"""Blocks of worlds, bodies and environments: tasks, MuJoCo models, muscles."""
