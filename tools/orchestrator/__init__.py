"""The orchestrator: couples FMUs as a scenario says, runs them, and writes the run with its provenance."""

from .run import Run, Simulation, default_folder, simulate

__all__ = ["Run", "Simulation", "default_folder", "simulate"]
