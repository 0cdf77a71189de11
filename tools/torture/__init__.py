"""Attacks that count: kills, damaged files and mutated inputs, added up over many sessions."""
