"""What to measure so that sets of effects can be told apart."""

from collections.abc import Sequence

from ...models.effects import EffectPlace

SHOWN_BY = {
    "gyro-bias": "a rest of a minute and more before and after the motion",
    "gyro-bias-drift": "rests at the beginning and at the end of a longer record",
    "gyro-scale-misalignment": "several whole turns about each axis, and back",
    "gyro-scale-asymmetry": "whole turns about each axis in one sense, then as many in the other",
    "gyro-g-sensitivity": "rests with each axis up and with each axis down",
    "gyro-g-squared": "rests with each axis up and down, and with two axes at 45°",
    "latency": "fast turns to and fro about each axis, compared with the true attitude while they last",
    "undersampling": "the same motion at another sampling rate",
    "jitter": "the same motion with time stamps from another clock",
}
"""What tells each effect of the gyros from the others."""
OF_ACCELEROMETERS = "rests with each axis up, down and between, some of them repeated at the end"


def what_separates(sets: Sequence[Sequence[EffectPlace]], reference: str) -> tuple[str, ...]:
    """What to add to the record, for the effects that not all sets have.

    Parameters
    ----------
    sets : sequence of sequence of EffectPlace
        the sets that remain
    reference : str
        "gravity" or "true attitude"
    """
    common = set(sets[0]).intersection(*sets[1:])
    open_effects = dict.fromkeys(place.effect for places in sets for place in places if place not in common)
    shown_by: dict[str, list[str]] = {}
    for name in open_effects:
        shown_by.setdefault(SHOWN_BY.get(name, OF_ACCELEROMETERS), []).append(name)
    said = [f"{what} (shows {', '.join(names)})" for what, names in shown_by.items()]
    if reference == "gravity" and "latency" in open_effects:
        said.append("the true attitude beside the record: between rests latency leaves no error")
    return tuple(said)
