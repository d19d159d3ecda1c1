"""Identification of a device from records of its bench. Entry point: entry.py, which `fg.identify` calls."""
