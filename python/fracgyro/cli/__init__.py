"""The command line, by groups of commands. Bad input ends with exit code 2 and one sentence."""

from .main import cli, main

__all__ = ["cli", "main"]
