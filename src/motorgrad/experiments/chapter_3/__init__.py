"""Chapter 3: the learner."""
