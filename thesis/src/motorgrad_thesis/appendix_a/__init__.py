"""Appendix A: the geometry of muscles, and the circular force field."""
