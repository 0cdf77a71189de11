"""The blocks, one file each. `motorgrad.lab` gives them away."""
