"""Chapter 6: what lies beyond, in section 6.5.4: hierarchies, navigation, a body, thousands of units."""
