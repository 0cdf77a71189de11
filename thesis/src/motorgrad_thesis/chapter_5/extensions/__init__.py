"""Extensions of the hexapod: other bodies and muscles, 24 independent muscles, synergies and motor primitives."""
