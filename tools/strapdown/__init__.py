"""Records of gyros and accelerometers without a table: what they support, and what their rests say."""

from .inspection import Inspection, inspect_record

__all__ = ["Inspection", "inspect_record"]
