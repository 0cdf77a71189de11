"""The hexapod on 24 muscles, which fire independently: beyond section 5.3.4."""
