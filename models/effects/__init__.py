"""The catalogue of effects."""
