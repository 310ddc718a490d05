"""What the simulation gets wrong: falsify the model, name the cause, extend the model, measure the gain."""

from .procedure import diagnose
from .result import Cause, Diagnosis

__all__ = ["Cause", "Diagnosis", "diagnose"]
