"""Chapter 6: local policies of a fixed size; in `growing`, those that grow; in `further`, what section 6.5.4 adds."""
