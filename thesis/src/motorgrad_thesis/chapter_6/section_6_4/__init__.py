"""Section 6.4: policies that grow unit by unit."""
