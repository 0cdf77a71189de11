"""Chapter 5: muscles and the hopper."""
