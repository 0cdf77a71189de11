"""Chapter 7: what the thesis proposes for the future."""
