"""Chapter 6: policies that grow, unit by unit."""
