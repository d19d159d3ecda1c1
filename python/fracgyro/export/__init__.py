"""A scenario's controller for other places: firmware.py."""
