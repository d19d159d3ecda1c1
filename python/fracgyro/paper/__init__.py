"""The paper, reproduced. Page one is reproduce.py."""
