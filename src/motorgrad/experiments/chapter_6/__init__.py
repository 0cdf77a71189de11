"""Chapter 6: local policies, and units that are added one by one."""
