"""The hexapod's experiments: sections 5.3 and 5.4.1, figures 5.6 to 5.9."""
