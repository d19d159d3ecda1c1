"""A tuning: the best parameters that a search finds, judged on seeds that it has not seen. Page one: run.py."""
