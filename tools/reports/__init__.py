"""What a person sees of each kind of result."""

from ..planning.check import SettingCheck
from ..planning.plan import Curve, Plans, PositionPlan
from ..result import Result
from ..summaries import text_of as text_of_others
from .plan import check_lines, curve_lines, plan_lines, position_lines

LINES = {Plans: plan_lines, PositionPlan: position_lines, Curve: curve_lines, SettingCheck: check_lines}


def text_of(result: Result) -> str:
    """What a person reads of a result; the first line is the verdict."""
    lines = LINES.get(type(result))
    return text_of_others(result) if lines is None else "\n".join(lines(result))
