"""MuJoCo models from anywhere: read, bounded and compiled."""
