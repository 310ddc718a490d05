"""Measured files as laboratories write them, from clean arrays: many dialects, each with its necessary answers.

This module does not use the product: Python formats the numbers, and every factor is written again.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta
from typing import Any

import numpy as np

G = 9.80665
START = datetime(2026, 3, 17, 9, 30, 0)


@dataclass(frozen=True)
class Bench:
    """A clean run: times (N,) [s], angles (N,) [deg], readings (N, 3) [m/s²], temperatures (N,) [°C]."""

    time: np.ndarray
    alpha: np.ndarray
    beta: np.ndarray
    force: np.ndarray
    temperature: np.ndarray


@dataclass(frozen=True)
class LabFile:
    """A file of a laboratory.

    `needs` are exactly the answers without which it cannot be understood, in this number of `rounds`; `wrong` are
    others. `grain` is half a last digit of its readings [m/s²], `rows` are its rests of the run, `keeps` is the content
    of its head.
    """

    name: str
    content: bytes
    needs: dict[str, str] = field(default_factory=dict)
    suffix: str = ".csv"
    wrong: dict[str, str] = field(default_factory=dict)
    rounds: int = 1
    keeps: dict[str, str] = field(default_factory=dict)
    rows: np.ndarray | None = None
    grain: float = 6e-9


FORCES = {
    "m/s2": (1.0, 9),
    "g": (1.0 / G, 11),
    "mg": (1e3 / G, 8),
    "µg": (1e6 / G, 5),
    "V": (0.25 / G, 11),
    "counts": (1e7 / G, 2),
}
"""Units of specific force: factor, and number of written decimals."""
OWN = ["position", "time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2"]
GERMAN = ["Nr.", "Zeit [s]", "Außenwinkel [°]", "Innenwinkel [°]", "ax [g]", "ay [g]", "az [g]"]
PLAIN = ["No", "t [s]", "alpha [deg]", "beta [deg]", "acc x [m/s²]", "acc y [m/s²]", "acc z [m/s²]"]


def table(
    names: Sequence[str],
    columns: Sequence[Sequence[str]],
    *,
    sep: str = ",",
    before: Sequence[str] = (),
    after: Sequence[str] = (),
    units: Sequence[str] | None = None,
    trailing: str = "",
    end: str = "\n",
    encoding: str = "utf-8",
) -> bytes:
    lines = [*before, sep.join(names) + trailing]
    if units is not None:
        lines.append(sep.join(units) + trailing)
    lines += [sep.join(row) + trailing for row in zip(*columns, strict=True)]
    return (end.join([*lines, *after]) + end).encode(encoding)


def numbers(values: np.ndarray, decimals: int, mark: str = ".") -> list[str]:
    return [f"{value:.{decimals}f}".replace(".", mark) for value in values.tolist()]


def texts_of(bench: Bench, mark: str = ".", scale: float = 1.0, decimals: int = 9) -> dict[str, list[str]]:
    """Return number, time, angles and readings (times `scale`) as texts."""
    x, y, z = (bench.force * scale).T
    return {
        "no": [str(k) for k in range(1, len(bench.time) + 1)],
        "t": numbers(bench.time, 1, mark),
        "alpha": numbers(bench.alpha, 4, mark),
        "beta": numbers(bench.beta, 4, mark),
        "x": numbers(x, decimals, mark),
        "y": numbers(y, decimals, mark),
        "z": numbers(z, decimals, mark),
    }


def bench_columns(bench: Bench, *, scale: float = 1.0, decimals: int = 9, mark: str = ".") -> list[list[str]]:
    """The columns of `texts_of` in their order."""
    return list(texts_of(bench, mark, scale, decimals).values())


def arc(value: float, mark: str = ".", form: str = "{s}{d}°{m:02d}'{t}\"") -> str:
    """Return degrees, minutes and seconds with three decimals."""
    thousandths = round(abs(value) * 3_600_000)
    degrees, rest = divmod(thousandths, 3_600_000)
    minutes, rest = divmod(rest, 60_000)
    text = f"{rest / 1000.0:06.3f}".replace(".", mark)
    return form.format(s="-" if value < 0 else "", d=degrees, m=minutes, t=text)


def clock(seconds: float, form: str) -> str:
    return (START + timedelta(seconds=float(seconds))).strftime(form)


def clocks(seconds: np.ndarray, form: str) -> list[str]:
    return [clock(second, form) for second in seconds]


def in_form(texts: Sequence[str], form: str) -> list[str]:
    return [form.format(text) for text in texts]


def grouped(texts: Sequence[str], between: str, mark: str) -> list[str]:
    """Return numbers with a mark between thousands."""
    marks = str.maketrans(",.", between + mark)
    return [f"{float(text):,.5f}".translate(marks) for text in texts]


def position_files(bench: Bench) -> list[LabFile]:
    """Return CSV dialects of a position record."""
    files: list[LabFile] = []
    count = len(bench.time)

    def add(
        name: str,
        names: Sequence[str] | str,
        unit: str = "m/s2",
        *,
        mark: str = ".",
        columns: dict[str, list[str]] | None = None,
        layout: dict[str, Any] | None = None,
        **fields: Any,
    ) -> None:
        """Add a file: names, unit and decimal mark of its readings, changed columns, layout."""
        texts = texts_of(bench, mark, *FORCES[unit]) | (columns or {})
        head = names.split(";") if isinstance(names, str) else names
        content = table(head, [column for column in texts.values() if column], **(layout or {}))
        files.append(LabFile(name, content, **fields))

    point, comma = texts_of(bench), texts_of(bench, ",")
    before = ["Kalibrierung Drehtisch", "Seriennummer: A-0017", "Prüfer: Jürgen Groß", "Datum: 17.03.2026", ""]
    keeps = {"Seriennummer": "A-0017", "Prüfer": "Jürgen Groß", "Datum": "17.03.2026"}
    semicolon: dict[str, Any] = {"mark": ",", "layout": {"sep": ";"}}
    windows = {"sep": ";", "before": before, "end": "\r\n", "encoding": "cp1252"}
    utf_16 = {"sep": "\t", "before": before, "end": "\r\n", "encoding": "utf-16"}

    add("semicolon, decimal comma", OWN, **semicolon)
    add("tab, decimal comma", OWN, mark=",", layout={"sep": "\t"}, suffix=".txt")
    add("tab, decimal point", OWN, layout={"sep": "\t"}, suffix=".dat")
    add("bar", OWN, layout={"sep": "|"})
    add("blanks", OWN, layout={"sep": "   "}, suffix=".txt")
    add("German Windows", GERMAN, "g", mark=",", layout=windows, keeps=keeps)
    utf_8 = {"sep": ";", "before": before, "encoding": "utf-8-sig"}
    add("German, UTF-8 with mark", GERMAN, "g", mark=",", layout=utf_8, keeps=keeps)
    add("German, UTF-16", GERMAN, "g", mark=",", layout=utf_16, keeps=keeps)
    add("sep= of Excel", OWN, mark=",", layout={"sep": ";", "before": ["sep=;"], "end": "\r\n"})
    add("trailing separators", OWN, mark=",", layout={"sep": ";", "trailing": ";;"})
    padded = {"sep": ";", "before": ["Messung 12;;;;;;", "Prüfer;Meier;;;;;", ";;;;;;"]}
    add("title padded by Excel", GERMAN, "g", mark=",", layout=padded, keeps={"Prüfer": "Meier"})
    add("other names", PLAIN)
    names = "Pos.;Time;Outer angle;Inner angle;Accel X;Accel Y;Accel Z"
    add("row of units", names, "g", layout={"units": ["-", "s", "deg", "deg", "g", "g", "g"]})
    add("units behind a slash", "Nr;Zeit / s;alpha / °;beta / °;fx / mg;fy / mg;fz / mg", "mg", **semicolon)
    add("micro g", "pos;t_s;alpha_deg;beta_deg;a1 (µg);a2 (µg);a3 (µg)", "µg")
    bare = "pos;time [s];alpha [deg];beta [deg];ax;ay;az"
    add("g or m/s²?", bare, "g", needs={"units.force": "g"}, wrong={"units.force": "m/s2"})
    add("m/s² or g?", bare, needs={"units.force": "m/s2"}, wrong={"units.force": "g"})
    no_angle = "pos;time [s];alpha;beta;ax [g];ay [g];az [g]"
    add("degrees by gravity", no_angle, "g")
    radians = {"alpha": numbers(np.radians(bench.alpha), 8), "beta": numbers(np.radians(bench.beta), 8)}
    add("radians by gravity", no_angle, "g", columns=radians)
    add("radians said", "pos;time [s];alpha [rad];beta [rad];ax [g];ay [g];az [g]", "g", columns=radians)
    grad = "Nr;Zeit [s];alpha [Grad];beta [Grad];ax [g];ay [g];az [g]"
    add("Grad", grad, "g", needs={"units.angle": "deg"}, **semicolon)
    in_volts = "pos;time [s];alpha [deg];beta [deg];ax [V];ay [V];az [V]"
    add("volts", in_volts, "V", needs={"units.force": "0.25 V/g"})
    add("counts", in_volts.replace("V", "counts"), "counts", needs={"units.force": "10000000 counts/g"})
    within = {name: (angle + 180.0) % 360.0 - 180.0 for name, angle in (("alpha", bench.alpha), ("beta", bench.beta))}
    add("angles within 180", PLAIN, columns={name: numbers(angle, 4) for name, angle in within.items()})
    no_unit = ["No", "t [s]", "alpha", "beta", *PLAIN[4:]]
    arcs = {"alpha": list(map(arc, bench.alpha)), "beta": list(map(arc, bench.beta))}
    add("sexagesimal", no_unit, columns=arcs)
    for name, angle in (("alpha", bench.alpha), ("beta", bench.beta)):
        arcs[name] = [arc(value, ",", "{s}{d}:{m:02d}:{t}") for value in angle]
    add("sexagesimal with colons", no_unit, columns=arcs, **semicolon)
    add("times of day", ["No", "Time of day", *PLAIN[2:]], columns={"t": clocks(bench.time, "%H:%M:%S.%f")})
    add("ISO dates", ["No", "Timestamp", *PLAIN[2:]], columns={"t": clocks(bench.time, "%Y-%m-%dT%H:%M:%S.%f")})
    days, hours = clocks(bench.time, "%d.%m.%Y"), clocks(bench.time, "%H:%M:%S,%f")
    day_and_hour = {"t": in_form([f"{day};{hour}" for day, hour in zip(days, hours, strict=True)], "{}")}
    add("date and time of one day", ["Nr", "Datum", "Uhrzeit", *GERMAN[2:]], "g", columns=day_and_hour, **semicolon)
    early = [
        (datetime(2026, 2, 1) + timedelta(days=k)).strftime("%d.%m.%Y") + " 10:00:00" for k in range(min(count, 12))
    ]
    short = {name: texts[: len(early)] for name, texts in comma.items()}
    add(
        "1 February or 2 January?",
        ["Nr", "Datum/Zeit", *GERMAN[2:4], *PLAIN[4:]],
        columns=short | {"t": early},
        needs={"dates": "day-first"},
        wrong={"dates": "month-first"},
        rows=np.arange(len(early)),
        **semicolon,
    )
    unnamed = ["No", "Time", *PLAIN[2:]]
    minutes = [f"{int(t) // 60:02d}:{int(t) % 60:02d}" for t in bench.time]
    add("hours or minutes?", unnamed, columns={"t": minutes}, needs={"clock": "m:s"})
    ms = {"t": numbers(bench.time * 1e3, 0)}
    add("unit of time?", unnamed, columns=ms, needs={"units.time": "ms"})
    add("milliseconds said", ["No", "Time [ms]", *PLAIN[2:]], columns=ms)
    add("no time", [PLAIN[0], *PLAIN[2:]], columns={"t": []})
    files += _of_three_digits(bench)
    micro_g = {
        axis: [f'"{int(float(v)):,}"' for v in numbers(1e6 / G * bench.force[:, k], 0)] for k, axis in enumerate("xyz")
    }
    add(
        "1,234 beside 20.0",
        "pos;t_s;alpha_deg;beta_deg;a1 [µg];a2 [µg];a3 [µg]",
        columns=micro_g,
        needs={} if any(text.count(",") > 1 for texts in micro_g.values() for text in texts) else {"thousands": ","},
        grain=0.5e-6 * G,
    )
    axes = {"columns.alpha_deg": "Axis 1 [deg]", "columns.beta_deg": "Axis 2 [deg]"}
    add("which axis is which?", ["No", "t [s]", *axes.values(), *PLAIN[4:]], needs=axes)
    columns = {"columns.alpha_deg": "3", "columns.beta_deg": "4", "columns.force": "5,6,7"}
    answers = {"units.angle": "deg", "units.force": "m/s2"}
    rows = [",".join(row) for row in zip(*point.values(), strict=True)]
    needs = {"kind": "position record"} | columns | answers
    files.append(LabFile("no names", table([], [], before=rows), needs=needs, rounds=2))
    hole = comma | {"x": list(comma["x"]), "y": list(comma["y"])}
    hole["x"][3], hole["y"][6] = "n/a", ""
    add("n/a and empty cells", OWN, columns=hole, rows=np.delete(np.arange(count), [3, 6]), **semicolon)
    words = [*point["x"][:3], "OVL", *point["x"][4:]]
    add("OVL", OWN, columns={"x": words}, needs={"missing": "OVL"}, rows=np.delete(np.arange(count), 3))
    footer = {"sep": ";", "after": ["", "Ende der Messung", "Bemerkung: keine"]}
    add("footer", GERMAN, "g", mark=",", layout=footer, keeps={"Bemerkung": "keine"})
    warm = {"temperature": numbers(bench.temperature, 4), "remark": ["ok"] * count}
    add("temperature in °C", [*PLAIN, "Temp [°C]", "Remark"], columns=warm)
    warm = {"temperature": numbers(bench.temperature * 1.8 + 32.0, 4)}
    add("temperature in °F", [*PLAIN, "Temperature (°F)"], columns=warm)
    warm = {"temperature": numbers(bench.temperature + 273.15, 4, ",")}
    add("temperature in K", [*GERMAN[:4], *PLAIN[4:], "Temperatur [K]"], columns=warm, **semicolon)
    names = in_form([text.replace('"', '""') for text in PLAIN], '"{}"')
    add("everything quoted", names, columns={name: in_form(texts, '"{}"') for name, texts in point.items()})
    add("quoted decimal commas", PLAIN, columns={name: in_form(texts, '"{}"') for name, texts in comma.items()})
    units = {"t": "{} s", "alpha": "{}°", "beta": "{}°", "x": "{} m/s²", "y": "{} m/s²", "z": "{} m/s²"}
    with_units = {name: in_form(point[name], form) for name, form in units.items()}
    add("units in the cells", "No;t;alpha;beta;ax;ay;az", columns=with_units)
    swiss = texts_of(bench, ".", *FORCES["µg"])
    micro = "pos;t_s;alpha_deg;beta_deg;a1 [µg];a2 [µg];a3 [µg]"
    add("apostrophes between thousands", micro, columns={axis: grouped(swiss[axis], "'", ".") for axis in "xyz"})
    dotted = {axis: grouped(swiss[axis], ".", ",") for axis in "xyz"}
    add("points between thousands", micro, columns=dotted, **semicolon)
    about = {"Serial number": "SN 4711", "Bench": "T2", "Operator": "Ann Lee"}
    add("head of cells", PLAIN, layout={"before": [f"{key},{text}" for key, text in about.items()]}, keeps=about)
    return files


def _of_three_digits(bench: Bench) -> list[LabFile]:
    """Return files in mg with three digits behind every mark, which may therefore separate thousands."""
    rows = np.flatnonzero(np.abs(bench.force).min(axis=1) > 0.02 * G)
    some = Bench(bench.time[rows], bench.alpha[rows], bench.beta[rows], bench.force[rows], bench.temperature)
    columns = [
        [str(k + 1) for k in range(len(rows))],
        numbers(some.time, 0),
        numbers(some.alpha, 0),
        numbers(some.beta, 0),
    ]
    names = [*PLAIN[:4], "fx [mg]", "fy [mg]", "fz [mg]"]
    files = []
    for mark, wrong_mark, word in ((",", ".", "1,234: a comma"), (".", ",", "1.234: a point")):
        forces = [numbers(1e3 * force / G, 3, mark) for force in some.force.T]
        content = table(names, columns + forces, sep=";")
        needs, wrong = {"decimal": mark}, {"decimal": wrong_mark}
        name = f"{word} between digits of all numbers"
        files.append(LabFile(name, content, needs=needs, wrong=wrong, rows=rows, grain=0.5e-6 * G))
    return files


def repeated_file(bench: Bench, readings: int, scatter: float, seed: int, *, numbered: bool = True) -> LabFile:
    """Return several readings at every position, with noise of that standard deviation [m/s²]."""
    noise = np.random.default_rng(seed).normal(0.0, scatter, (len(bench.time), readings, 3))
    rows = np.repeat(np.arange(len(bench.time)), readings)
    time = bench.time[rows] + np.tile(np.arange(readings), len(bench.time))
    force = bench.force[rows] + noise.reshape(-1, 3)
    texts = texts_of(Bench(time, bench.alpha[rows], bench.beta[rows], force, bench.temperature))
    texts["no"] = [str(k + 1) for k in rows]
    if numbered:
        return LabFile(f"{readings} readings", table(PLAIN, list(texts.values())))
    content = table(PLAIN[1:], list(texts.values())[1:])
    return LabFile(f"{readings} readings", content, needs={"readings": "average"})


@dataclass(frozen=True)
class Block:
    """A run of gyros and accelerometers: times (N,) [s], rates (N, 3) [rad/s], specific forces (N, 3) [m/s²]."""

    time: np.ndarray
    rate: np.ndarray
    force: np.ndarray


def block_columns(block: Block, rate: float, force: float, *, mark: str = ".", decimals: int = 9) -> list[list[str]]:
    """Return rates and forces times a factor as texts."""
    scaled = np.hstack([block.rate * rate, block.force * force])
    return [numbers(column, decimals, mark) for column in scaled.T]


def labview(
    names: Sequence[str],
    units: Sequence[str],
    columns: list[list[str]],
    *,
    mark: str = ",",
    x: bool = True,
    period: float,
) -> bytes:
    """Return a LabVIEW measurement file; without `x` its rows have no time, only a period."""
    count = len(names)
    head = [
        "LabVIEW Measurement\t",
        "Writer_Version\t2",
        "Reader_Version\t2",
        "Separator\tTab",
        f"Decimal_Separator\t{mark}",
        "Multi_Headings\tYes",
        f"X_Columns\t{'One' if x else 'No'}",
        "Time_Pref\tRelative",
        "Operator\tmeier",
        "Date\t2026/03/17",
        "Time\t09:30:00,1234567",
        "***End_of_Header***\t",
        "\t",
        f"Channels\t{count}" + "\t" * count,
        "Samples\t" + "\t".join([str(len(columns[0]))] * count),
        "Date\t" + "\t".join(["2026/03/17"] * count),
        "Time\t" + "\t".join([f"09:30:00{mark}1234567"] * count),
        "Y_Unit_Label\t" + "\t".join(units),
        "X_Dimension\t" + "\t".join(["Time"] * count),
        "X0\t" + "\t".join([f"0{mark}0E+0"] * count),
        "Delta_X\t" + "\t".join([f"{period}".replace(".", mark)] * count),
        "***End_of_Header***" + "\t" * count,
        "X_Value\t" + "\t".join(names) + "\tComment",
    ]
    rows = ["\t".join(row) for row in zip(*columns, strict=True)]
    return ("\r\n".join([*head, *rows]) + "\r\n").encode("cp1252")


def strapdown_files(block: Block) -> list[LabFile]:
    """Return logs of gyros and accelerometers: counts, deg/s, g; time in ms, µs, sample numbers at a rate, of the
    day."""
    b, degrees = block, 180.0 / np.pi
    plain = block_columns(b, 1.0, 1.0)
    ours = block_columns(b, degrees, 1.0 / G, decimals=11)
    german = block_columns(b, degrees, 1.0 / G, mark=",", decimals=11)
    t, ms, us = numbers(b.time, 4), [f"{v * 1e3:.1f}" for v in b.time], [f"{v * 1e6:.0f}" for v in b.time]
    samples = [str(k) for k in range(len(b.time))]
    names = ["gyro x [deg/s]", "gyro y [deg/s]", "gyro z [deg/s]", "acc x [g]", "acc y [g]", "acc z [g]"]
    short = ["gx", "gy", "gz", "ax", "ay", "az"]
    rate = f"{1.0 / float(b.time[1] - b.time[0]):g} Hz"
    counts = block_columns(b, 1e6 * degrees, 1e7 / G, decimals=0)
    day = [clock(v, "%H:%M:%S.%f") for v in b.time]
    epoch = [f"{1773739800 + v:.4f}" for v in b.time]
    still = [["1.0"] * len(b.time), *[["0.0"] * len(b.time)] * 3]
    warm = [f"{20 + 0.001 * k:.3f}" for k in range(len(b.time))]
    lvm = [numbers(b.time, 4, ","), *german]
    units = ["deg/s"] * 3 + ["g"] * 3
    period = float(b.time[1] - b.time[0])
    return [
        LabFile("log in ms", table(["time [ms]", *names], [ms, *ours])),
        LabFile("log in µs, German", table(["Zeit [µs]", *names], [us, *german], sep=";", encoding="cp1252")),
        LabFile(
            "log in s, SI", table(["t_s", *(f"w{k}_rad/s" for k in "xyz"), *(f"f{k}_m/s2" for k in "xyz")], [t, *plain])
        ),
        LabFile("sample numbers", table(["sample", *names], [samples, *ours]), needs={"units.time": rate}),
        LabFile("no time", table(names, ours), needs={"units.time": rate}),
        LabFile(
            "counts of both",
            table(["time [s]", *(f"{name[:6].strip()} [LSB]" for name in names)], [t, *counts]),
            needs={"units.rate": "1000000 LSB/(deg/s)", "units.force": "10000000 LSB/g"},
        ),
        LabFile(
            "no units",
            table(["time [s]", "gyro x", "gyro y", "gyro z", "acc x", "acc y", "acc z"], [t, *ours]),
            needs={"units.rate": "deg/s", "units.force": "g"},
        ),
        LabFile(
            "gx and ax",
            table(["time_s", *short], [t, *ours], before=["# Log of IMU 4"]),
            needs={"units.force": "g", "units.rate": "deg/s"},
        ),
        LabFile(
            "gx with a unit",
            table(["time_s", *(f"{n} [dps]" for n in short[:3]), *(f"{n} [g]" for n in short[3:])], [t, *ours]),
        ),
        LabFile("time of day", table(["Time", *names], [day, *ours])),
        LabFile(
            "names that only their units tell",
            table(
                [
                    "#timestamp [ns]",
                    *(f"w_RS_S_{k} [rad s^-1]" for k in "xyz"),
                    *(f"a_RS_S_{k} [m s^-2]" for k in "xyz"),
                ],
                [[f"{1403636579758555392 + round(v * 1e9)}" for v in b.time], *plain],
            ),
        ),
        LabFile(
            "messages of a robot",
            table(
                ["%time", "field.header.seq"]
                + [f"field.{name}.{k}" for name in ("angular_velocity", "linear_acceleration") for k in "xyz"],
                [[f"{1403636579758555392 + round(v * 1e9)}" for v in b.time], samples, *plain],
            ),
            needs={"units.time": "ns", "units.rate": "rad/s", "units.force": "m/s2"},
        ),
        LabFile(
            "channels counted from 0",
            table(
                ["timestamp_us", *(f"gyro[{k}] (deg/s)" for k in range(3)), *(f"acc[{k}] (g)" for k in range(3))],
                [us, *ours],
            ),
        ),
        LabFile(
            "seconds of the week",
            table(["week", "TOW [s]", *names], [["2300"] * len(t), t, *ours]),
        ),
        LabFile("milliseconds as a name", table(["millis", *names], [ms, *ours])),
        LabFile("time of the epoch", table(["timestamp [s]", *names], [epoch, *ours])),
        LabFile("temperature", table(["time [s]", *names, "temp [°C]"], [t, *ours, warm])),
        LabFile(
            "quaternion",
            table(["time [s]", *names, "qw", "qx", "qy", "qz"], [t, *ours, *still]),
            needs={"attitude": "none"},
        ),
        LabFile(
            "LabVIEW",
            labview(["Gyro X", "Gyro Y", "Gyro Z", "Acc X", "Acc Y", "Acc Z"], units, lvm, period=period),
            suffix=".lvm",
            keeps={"Operator": "meier"},
        ),
        LabFile(
            "LabVIEW without times",
            labview(
                ["Gyro X", "Gyro Y", "Gyro Z", "Acc X", "Acc Y", "Acc Z"],
                units,
                [[""] * len(t), *ours],
                mark=".",
                x=False,
                period=period,
            ),
            suffix=".lvm",
        ),
        LabFile(
            "LabVIEW without units",
            labview(["Gyro X", "Gyro Y", "Gyro Z", "Acc X", "Acc Y", "Acc Z"], [""] * 6, lvm, period=period),
            suffix=".lvm",
            needs={"units.rate": "deg/s", "units.force": "g"},
        ),
    ]
