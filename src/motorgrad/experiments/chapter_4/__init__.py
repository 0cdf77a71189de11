"""Chapter 4: recruitment, and what makes exploration slow."""
