"""Chapter 3: the learner and its gradient estimates."""
