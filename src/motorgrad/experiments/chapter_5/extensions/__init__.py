"""The extensions that section 5.4.1 proposes."""
