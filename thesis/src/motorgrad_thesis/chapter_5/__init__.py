"""Chapter 5: muscles and the hopper; the hexapod and its extensions have folders of their own."""
