"""Section 4.4: growing pools, pathologies of learning, and the extensions of section 4.4.1."""
