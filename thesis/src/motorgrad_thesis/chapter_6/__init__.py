"""Chapter 6: local policies; growing ones in `section_6_4`, combinations and applications in `section_6_5`."""
