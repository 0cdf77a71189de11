"""Section 5.3.3: which body walks fast: a search for its numbers, and how strong its muscles are."""
