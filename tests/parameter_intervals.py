"""Intervals of parameter sets, read as another tool would."""

from pathlib import Path
from xml.etree import ElementTree


def intervals_in(path: Path) -> dict[str, tuple[float, float]]:
    """Return the ends of each parameter of an .ssv that has an interval."""
    ends = {}
    for parameter in ElementTree.parse(path).getroot().findall(".//{*}Parameter"):
        for interval in parameter.iter("interval"):
            ends[parameter.get("name")] = (float(interval.get("low", "-inf")), float(interval.get("high", "inf")))
    return ends
