"""Appendix A: the geometry of muscles."""
