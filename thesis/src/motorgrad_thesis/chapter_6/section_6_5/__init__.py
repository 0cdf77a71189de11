"""Section 6.5: mixtures, pruning, hierarchies, navigation, local units on a body, and a spatial index."""
