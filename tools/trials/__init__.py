"""Trials: hidden effects drawn, measured by simulation, diagnosed and judged, for every kind of record."""
