"""What the simulation gets wrong: falsify the model, name the cause, extend the model, measure the gain."""

from trihedron.diagnosis.procedure import diagnose
from trihedron.diagnosis.result import Cause, Diagnosis

__all__ = ["Cause", "Diagnosis", "diagnose"]
