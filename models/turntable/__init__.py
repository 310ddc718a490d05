"""The two-axis turntable: its kernel, increments of its attitude, its geometry, the command that holds an attitude."""

from .kernel import EARTH_RATE

__all__ = ["EARTH_RATE"]
