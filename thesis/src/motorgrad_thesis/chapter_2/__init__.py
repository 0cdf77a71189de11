"""Chapter 2: the decision process, and hill climbing."""
