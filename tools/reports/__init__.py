"""What a person sees of each kind of result."""

from importlib import import_module

from ..planning.check import SettingCheck
from ..planning.plan import Curve, Plans, PositionPlan
from ..result import Result
from ..summaries import text_of as text_of_others
from .plan import check_lines, curve_lines, plan_lines, position_lines

LINES = {Plans: plan_lines, PositionPlan: position_lines, Curve: curve_lines, SettingCheck: check_lines}
LATE = {
    "AttitudeComparison": ("inspection", "comparison_lines"),
    "AttitudeRun": ("inspection", "attitude_lines"),
    "CampaignResult": ("campaign_words", "campaign_lines"),
    "Comparison": ("campaign_words", "change_lines"),
    "Inspection": ("inspection", "inspection_lines"),
    "PublishedCalibration": ("papers", "published_lines"),
    "Reproduction": ("papers", "reproduction_lines"),
    "WordLength": ("papers", "word_length_lines"),
}
"""Kinds whose words need what the others do not."""


def text_of(result: Result) -> str:
    """What a person reads of a result; the first line is the verdict."""
    name = LATE.get(type(result).__name__)
    lines = LINES.get(type(result)) if name is None else getattr(import_module(f"{__name__}.{name[0]}"), name[1])
    return text_of_others(result) if lines is None else "\n".join(lines(result))
