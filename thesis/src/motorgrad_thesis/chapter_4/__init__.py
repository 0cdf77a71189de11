"""Chapter 4: motoneuron recruitment; section 4.4 has its own folder."""
