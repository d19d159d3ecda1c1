"""A tuning: search for the best parameters, validated on unseen seeds. Entry point: run.py."""
