"""Records from an exact model of its own, which shares no formula with the product.

The model is that of contracts: a table with errors of every kind in its axes, and a block of accelerometers and gyros
on it or in the hand. Errors are within a bound; effects have independent definitions.
"""

G = 9.80665
"""Gravity [m/s²]."""
SIGMA = 1e-5
"""Bound of the error of an averaged reading [g]."""
