"""Numbers, angles, times and units, a text at a time."""

import math
from pathlib import Path

import numpy as np
import pytest

from laboratory_imports import imported
from trihedron.tools.foreign import clock, parsed_moment, parsed_number, sexagesimal
from trihedron.tools.foreign.names import heading
from trihedron.tools.foreign.numbers import Marks
from trihedron.tools.foreign.units import known_unit, scaled_unit


@pytest.mark.parametrize(
    ("text", "decimal", "thousands", "value"),
    [
        ("1,5", ",", "", 1.5),
        ("1.5", ",", "", None),
        ("1.234,5", ",", ".", 1234.5),
        ("1.23,5", ",", ".", None),
        ("1'234'567.5", ".", "", 1234567.5),
        ("1 234", ".", "", 1234.0),
        ("0 250", ".", "", None),
        ("−5", ".", "", -5.0),
        ("1e400", ".", "", None),
        ("١", ".", "", None),
        ("1_0", ".", "", None),
        ("nan", ".", "", None),
    ],
)
def test_numbers(text: str, decimal: str, thousands: str, value: float | None):
    assert parsed_number(text, decimal, thousands) == value


@pytest.mark.parametrize(
    ("text", "degrees"),
    [
        ("12°34'56\"", 12 + 34 / 60 + 56 / 3600),
        ("-0°30'", -0.5),
        ("359:59:59,5", 359 + 59 / 60 + 59.5 / 3600),
        ("12 34.5", 12 + 34.5 / 60),
        ("12°60'00\"", None),
        ("12°10'60\"", None),
        ("12°10.5'30\"", None),
    ],
)
def test_angles(text: str, degrees: float | None):
    assert sexagesimal(text) == (None if degrees is None else pytest.approx(degrees, abs=1e-12))


@pytest.mark.parametrize(
    ("cell", "proves"),
    [
        ("1,234", ("", "", ",")),
        ("0,234", (",", "", "")),
        ("1,23", (",", "", "")),
        ("1,2345", (",", "", "")),
        ("1234,567", (",", "", "")),
        ("1,234e1", (",", "", "")),
        ("1,234,567", ("", ",", "")),
        ("1,234.5", (".", ",", "")),
        ("1 234,567", (",", "", "")),
        ("1234", ("", "", "")),
        ("a,b", ("", "", "")),
    ],
)
def test_what_a_number_proves_of_its_marks(cell: str, proves: tuple[str, str, str]):
    marks = Marks()
    marks.see(cell)
    assert tuple("".join(marks_of_kind) for marks_of_kind in (marks.decimal, marks.thousands, marks.doubtful)) == proves


def test_times_and_dates():
    assert clock("12:00:01 AM") == 1.0
    assert clock("12:00 pm") == 43200.0
    assert clock("10:15") is None
    assert (clock("10:15", "h:m"), clock("10:15", "m:s")) == (36900.0, 615.0)
    assert clock("10:15:60") is None
    february, january = parsed_moment("01.02.2026", "day-first"), parsed_moment("01.02.2026", "month-first")
    assert february is not None
    assert january is not None
    assert february - january == 30 * 86400.0
    assert parsed_moment("2026-02-01T10:00:00+01:00", "") == february + 9 * 3600.0
    assert parsed_moment("1. Feb 2026", "") == parsed_moment("February 1, 2026", "") == february
    assert parsed_moment("30.02.2026", "day-first") is None


@pytest.mark.parametrize(
    ("text", "factor"),
    [
        ("16384 LSB/g", 9.80665 / 16384),
        ("1/16384 g", 9.80665 / 16384),
        ("0.061 mg/LSB", 0.061e-3 * 9.80665),
        ("131 LSB/(deg/s)", math.pi / 180 / 131),
        ("7.6 mdps/LSB", 7.6e-3 * math.pi / 180),
        ("100 Hz", 0.01),
        ("°/h", math.pi / 180 / 3600),
        ("m·s⁻²", 1.0),
        ("gon", 0.9),
        ("0.5 g/deg", None),
        ("0 g", None),
        ("furlong", None),
        ("2 degF", None),
    ],
)
def test_units(text: str, factor: float | None):
    unit = scaled_unit(text)
    assert (None if unit is None else unit.factor) == (None if factor is None else pytest.approx(factor, rel=1e-12))


@pytest.mark.parametrize(
    ("text", "column"),
    [
        ("gx [g]", "f1_mps2"),
        ("gx [dps]", "w1_radps"),
        ("gx", ""),
        ("acc_y_m_s2", "f2_mps2"),
        ("gyro z (°/s)", "w3_radps"),
        ("mag x [uT]", ""),
        ("x", ""),
        ("T [°C]", "temperature_degC"),
        ("T", ""),
        ("Winkel außen / °", "alpha_deg"),
        ("alpha soll [°]", ""),
        ("Axis 1 [deg]", ""),
        ("std ax [g]", ""),
        ("roll [deg]", ""),
        ("delta theta x [rad]", "dtheta1_rad"),
    ],
)
def test_a_name_that_could_mean_two_columns_means_none(text: str, column: str):
    assert heading(text).column == column


@pytest.mark.parametrize(
    ("texts", "symbol"),
    [
        ("sec secs s second seconds Sekunden", "s"),
        ("ms msec msecs millis milliseconds MSEC", "ms"),
        ("us µs µsec micros microseconds", "us"),
        ("ns nsec nsecs nanos nanoseconds", "ns"),
        ("g G gee gees g-force gs", "g"),
        ("mg mgee milli-g milligee", "mg"),
        ("m/s² m/(s^2) m/s/s m/sec^2 meters/second^2 m_s2 m_per_s_squared m.s-2 N/kg", "m/s2"),
        ("ft/s/s feet/sec2 ft/s^2", "ft/s2"),
        ("deg/s dps °/s °/sec degrees/second deg_per_s deg.s-1", "deg/s"),
        ("rad/s radps radians/sec rad/second rad_per_s", "rad/s"),
        ("deg/h °/hr deg/hour dph", "deg/h"),
        ("rpm rev/min turns/minute", "turn/min"),
        ("mdeg/sec mdps", "mdeg/s"),
    ],
)
def test_words_of_a_unit_are_one_unit(texts: str, symbol: str):
    for text in texts.split():
        assert known_unit(text) == known_unit(symbol) is not None, text


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *[
            (name, "ms")
            for name in ("millis", "millis()", "time_millis", "timeMillis", "timestamp_msec", "Time (millis)")
        ],
        *[(name, "us") for name in ("micros", "timestamp_micros", "t_usec", "Elapsed Time (microseconds)")],
        *[(name, "ns") for name in ("nsec", "timestamp_nsec", "nanos", "elapsedRealtimeNanos", "time_nanoseconds")],
        *[(name, "s") for name in ("seconds_elapsed", "secs", "Unix Timestamp (s)", "sample_time_s")],
    ],
)
def test_a_time_by_its_unit_is_not_asked(name: str, unit: str, tmp_path: Path):
    size = known_unit(unit)
    assert size is not None
    times = [f"{0.01 * k / size.factor:.9g}" for k in range(40)]
    names = [name, *(f"acc {axis} [gee]" for axis in "xyz"), *(f"gyro {axis} [degrees per second]" for axis in "xyz")]
    rows = [f"{t},0.1,0.2,{0.97 + 0.001 * k:.3f},1.5,-2.5,{k}" for k, t in enumerate(times)]
    record = imported(tmp_path, "\n".join([",".join(names), *rows])).record
    assert np.diff(record.time_s) == pytest.approx(np.full(39, 0.01), rel=1e-6)
    assert record.specific_force[:, 0] == pytest.approx(0.980665)
    assert record.rate[:, 2] == pytest.approx(np.radians(np.arange(40.0)))
