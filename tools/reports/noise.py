"""Page of the noise of an instrument."""

from collections.abc import Mapping, Sequence

from ..document.blocks import Page, Section, Table, table_of
from ..document.notation import Cell
from ..noise import PROCESSES, ChannelNoise, Coefficient, Dwell, HeldOut, Letter, Noise, Sensor
from ..quantity import cells_of, quantities_of
from ..rounding import digits, upwards
from .pictures.noise import allan_parts_picture

FITS = 4.2
"""Largest deviation of a bin of the spectrum that a right fit shows."""
SHOWN = 3
"""Lines of the spectrum that are shown for a channel."""


def noise_text(result: Noise) -> str:
    """Return in a sentence which channels have other noise than the simulation, and with which processes."""
    wrong = []
    for one in result.against:
        if one.is_wrong:
            cause = " or ".join(one.alternatives) or "no set of two processes explains it"
            wrong.append(f"{one.channel} ({cause})")
    if not wrong:
        return f"{result.scenario} simulates the noise of the record."
    return f"{result.scenario} does not simulate the noise of the record: {', '.join(wrong)}."


def noise_page(result: Noise) -> Page:
    """Return the coefficients of each channel, what follows from them, and the Allan deviation."""
    answer = against_sections(result) + _sensor_sections(result)
    if result.averaged is not None:
        answer.append(Section("Averaged readings", averaged_lines(result.averaged)))
    if result.drifts:
        answer.append(Section("Growth of errors", [*GROWTH], table=_drifts(result)))
    return Page(
        f"Noise of {result.records[0].record}",
        _verdict(result),
        answer,
        lambda: _further(result),
        warnings=warnings_of(result),
        provenance={source.record: source.sha256 for source in result.records},
        sources=["IEEE Std 952 and IEEE Std 1293: names and units of the coefficients"],
    )


FOOT = "With 95 % intervals; `<` bounds a process that the record does not show."
UNITS: tuple[tuple[Sensor, str], ...] = (("gyro", "rad/s"), ("accelerometer", "m/s²"))
CAPTION = (
    "Allan deviation. Points: the record, with 95 % intervals. Line: the fitted processes, with the band of 95 % of "
    "records that have them."
)
AXES = ("axis 1", "axis 2", "axis 3")
EVEN = 1.25
"""Ends of an interval whose distances from the estimate differ by less than this factor are one number."""
GROWTH = (
    "Standard deviations by the noise detected, after a bias taken over one minute.",
    "`at most`: with the process that the record is too short to exclude.",
)


def _verdict(result: Noise) -> str:
    """Return the answer on the simulation's noise, where there is one; else the length and the processes."""
    if result.against:
        wrong = [one.channel for one in result.against if one.is_wrong]
        if not wrong:
            return f"Consistent: the record can have the noise that {result.scenario} simulates."
        return f"Falsified: {result.scenario} simulates other noise than the record has: {', '.join(wrong)}."
    return _summary(result)


def _summary(result: Noise) -> str:
    """Return the length of the record, and the processes of the worst channel of each sensor."""
    kind = "at rest throughout" if result.static else f"{result.stretches} rests"
    parts = []
    for sensor in ("gyro", "accelerometer"):
        channels = result.of(sensor)
        if channels:
            names = sorted({channel.processes for channel in channels}, key=len)
            parts.append(f"{sensor}s {', '.join(names)}")
    return f"Noise of {digits(result.duration_s, 4)} s at {digits(result.rate_hz, 4)} Hz, {kind}: {'; '.join(parts)}."


def against_sections(result: Noise) -> list[Section]:
    """Return the answer on the simulation's noise, channel by channel, and the gain on the second half."""
    if not result.against:
        return []
    rows = []
    for one in result.against:
        sensor = "gyro" if one.channel.startswith("gyro") else "accelerometer"
        changes = [_changed_text(letter, size, one.simulated, sensor) for letter, size in one.changed.items()]
        also = " or ".join(one.alternatives[1:]) or None
        rows.append([one.channel, one.verdict, ", ".join(changes) or None, also])
    table = Table(["channel", "the simulation's noise is", "with", "or with"], rows)
    sections = [Section(f"Against {result.scenario}", table=table)]
    gains: list[list[Cell]] = []
    for one in result.against:
        for held in one.held_out:
            gains.append([one.channel, *cells_of(held, HELD_COLUMNS)])
    head = ["channel", *(quantities_of(HeldOut)[name].heading for name in HELD_COLUMNS)]
    if gains:
        sections.append(Section("Gain on the second half", [GAIN], table=Table(head, gains)))
    return sections


HELD_COLUMNS = ("time_s", "windows", "coverage_simulated", "coverage_extended", "score")
GAIN = "Drifts of the second half, predicted by the simulation's noise and by that of the first half."


def _changed_text(letter: Letter, size: float, simulated: Mapping[Letter, float], sensor: Sensor) -> str:
    """Return a changed coefficient beside the simulated one, in the unit of data sheets."""
    unit = PROCESSES[letter].units[sensor]
    before = digits(unit.factor * simulated.get(letter, 0.0), 3)
    return f"{letter} {digits(unit.factor * size, 3)} {unit.data_sheet} (simulated: {before})"


def _sensor_sections(result: Noise) -> list[Section]:
    """Return a section for each sensor: the Allan deviation, and a row for each process, a column for each axis."""
    sections: list[Section] = []
    for sensor, unit in UNITS:
        channels = result.of(sensor)
        letters: dict[Letter, None] = {}
        for channel in channels:
            letters.update(dict.fromkeys(one.process for one in channel.coefficients))
        rows = []
        for letter in letters:
            ones = [channel.coefficient(letter) for channel in channels]
            first = next(one for one in ones if one is not None)
            cells: list[Cell] = [f"{letter} {first.name}", first.data_sheet_unit]
            rows.append(cells + [coefficient_text(one) for one in ones])
        if rows:
            paragraphs = [] if sections else [FOOT]
            table = Table(["process", "unit", *AXES], rows)
            picture = allan_parts_picture(channels, unit)
            sections.append(Section(f"{sensor.capitalize()}s", paragraphs, picture, CAPTION, table))
    return sections


def coefficient_text(one: Coefficient | None) -> str | None:
    """Return a coefficient in the unit of data sheets with its interval: "0.350 ± 0.002", "3.6 -0.8 +0.9" or "< 12"."""
    if one is None:
        return None
    if one.data_sheet_estimate is None:
        return "not bounded" if one.data_sheet_high is None else f"< {upwards(one.data_sheet_high)}"
    text = str(digits(one.data_sheet_estimate, 3))
    if one.data_sheet_low is not None and one.data_sheet_high is not None:
        below, above = one.data_sheet_estimate - one.data_sheet_low, one.data_sheet_high - one.data_sheet_estimate
        if max(below, above) < EVEN * min(below, above):
            text += f" ± {upwards(max(below, above))}"
        else:
            text += f" -{upwards(below)} +{upwards(above)}"
    if one.time_constant_s is not None:
        text += f", {digits(one.time_constant_s, 2)} s"
    return text


def averaged_lines(averaged: Dwell) -> list[str]:
    """Return the bound of averaged readings, and the best dwell."""
    lines = [
        f"σ = {upwards(averaged.sigma, 3)} g for {averaged.positions} positions of {digits(averaged.dwell_s, 4)} s "
        f"(all keep it with probability {digits(averaged.probability, 4)})."
    ]
    if averaged.not_excluded > 1.1 * averaged.deviation:
        least = averaged.sigma * averaged.deviation / averaged.not_excluded
        lines.append(f"Detected processes alone give {upwards(least, 3)} g; a longer record could confirm that.")
    if averaged.enough_s is not None and averaged.best_dwell_s is not None:
        lines.append(
            f"Best dwell {digits(averaged.best_dwell_s, 2)} s; from {digits(averaged.enough_s, 2)} s on σ is within "
            "10 % of the least."
        )
    else:
        lines.append("σ falls with the dwell, up to an hour.")
    return lines


def _drifts(result: Noise) -> Table:
    columns = ("time_s", "attitude_detected_deg", "attitude_deg", "velocity_detected_mps", "velocity_mps")
    return table_of(result.drifts, columns)


def warnings_of(result: Noise) -> list[str]:
    """Return what limits the coefficients: odd records, filters, bad fits, other sets, short records, lines."""
    lines = [*result.warnings, *(f"too short for {text}" for text in result.too_short_for)]
    for channel in result.channels:
        lines += _channel_warnings(channel)
    return lines


def _channel_warnings(channel: ChannelNoise) -> list[str]:
    lines = []
    if len(channel.admissible) > 1:
        lines.append(f"{channel.channel}: equally simple sets explain it: {' or '.join(channel.admissible)}")
    if channel.worst_bin > FITS:
        lines.append(
            f"{channel.channel}: no set of processes explains the spectrum (largest deviation "
            f"{digits(channel.worst_bin, 2)} standard deviations): vibration, or a start that still settles?"
        )
    elif channel.filtered:
        lines.append(
            f"{channel.channel}: above {digits(channel.band_hz, 3)} Hz the spectrum is that of a filter or of "
            "vibration; below it the coefficients hold"
        )
    for line in channel.lines[:SHOWN]:
        size = f"{digits(line.amplitude, 3)} {channel.unit}"
        lines.append(
            f"{channel.channel}: a line at {digits(line.frequency_hz, 4)} Hz, of amplitude {size}, is left out"
        )
    return lines


def _further(result: Noise) -> Sequence[Section]:
    """Return the coefficients in SI units."""
    rows = []
    for channel in result.channels:
        for one in channel.coefficients:
            numbers = [None if value is None else digits(value, 4) for value in (one.estimate, one.low, one.high)]
            rows.append([channel.channel, one.process, *numbers, one.unit])
    return [Section("SI units", table=Table(["channel", "process", "estimate", "low", "high", "unit"], rows))]
