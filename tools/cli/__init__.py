"""The command line: options once, answers, commands."""

from .app import app, main

__all__ = ["app", "main"]
