"""The hexapod: its parts in numbers, its sensors, its fixed controllers, and measures of its gait."""
