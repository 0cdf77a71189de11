"""Walking tasks on the hexapod: with muscles or synergies, in steps, and by a clock on slopes."""
