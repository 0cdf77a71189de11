"""Accuracy and cost of TimLab's solvers on twelve systems with known answers, beside PathSim."""
