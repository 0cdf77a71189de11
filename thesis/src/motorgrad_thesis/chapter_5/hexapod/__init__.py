"""The hexapod: its body, the fixed controller, and the gaits that it learns (sections 5.3 and 5.4.1, figures 5.6 to
5.9)."""
