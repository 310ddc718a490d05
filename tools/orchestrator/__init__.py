"""The orchestrator: couples FMUs as a scenario says, runs them, and writes the run with its provenance."""

from .simulation import Run, default_folder, simulate

__all__ = ["Run", "default_folder", "simulate"]
