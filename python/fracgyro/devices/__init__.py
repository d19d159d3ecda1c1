"""Scenarios of devices from a data sheet or from a bench: what both share. Entry point for data sheets: sheet.py."""
