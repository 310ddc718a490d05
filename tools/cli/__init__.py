"""The command line: options once, answers, commands."""

from .app import app, main, program

__all__ = ["app", "main", "program"]
