"""Bounded-error mathematics: programmes, bounds of sets, what is left possible. Knows no record and no instrument."""
