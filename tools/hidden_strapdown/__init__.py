"""Strapdown records with hidden effects: made by simulation, diagnosed, counted."""
