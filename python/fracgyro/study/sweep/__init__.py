"""A sweep: every point of a design with every seed -> rows of metrics and their summary. Entry point: run.py."""
