"""Muscles and servos: their law, their path around joints, and the callback that brings the law into MuJoCo."""
