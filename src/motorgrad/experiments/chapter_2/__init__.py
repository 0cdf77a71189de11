"""Chapter 2: the decision process and policy search."""
