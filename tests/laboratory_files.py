"""Measured files as laboratories write them, from clean arrays: many dialects, each with what has to be said of it.

Nothing here knows the product: numbers are written by Python's own formatting, and every factor is spelled out again.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

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

    `needs` are the answers without which it cannot be understood, exactly those, in so many `rounds`, `wrong` others;
    `grain` is half a last digit of its readings [m/s²], `rows` which rests of the run it has, `keeps` what its head
    says.
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


def fixed(decimals: int, mark: str = ".") -> Callable[[float], str]:
    return lambda value: f"{value:.{decimals}f}".replace(".", mark)


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
    return [fixed(decimals, mark)(float(value)) for value in values]


def bench_columns(
    bench: Bench, *, scale: float = 1.0, decimals: int = 9, mark: str = ".", angle: int = 4
) -> list[list[str]]:
    """Number, time, angles and readings (times `scale`) as texts."""
    return [
        [str(k) for k in range(1, len(bench.time) + 1)],
        numbers(bench.time, 1, mark),
        numbers(bench.alpha, angle, mark),
        numbers(bench.beta, angle, mark),
        *(numbers(bench.force[:, axis] * scale, decimals, mark) for axis in range(3)),
    ]


def arc(value: float, mark: str = ".", form: str = "{s}{d}°{m:02d}'{t}\"") -> str:
    """Degrees, minutes and seconds with three decimals."""
    thousandths = round(abs(value) * 3_600_000)
    degrees, rest = divmod(thousandths, 3_600_000)
    minutes, rest = divmod(rest, 60_000)
    text = f"{rest / 1000.0:06.3f}".replace(".", mark)
    return form.format(s="-" if value < 0 else "", d=degrees, m=minutes, t=text)


def clock(seconds: float, form: str) -> str:
    return (START + timedelta(seconds=float(seconds))).strftime(form)


OWN = ("position", "time_s", "alpha_deg", "beta_deg", "f1_mps2", "f2_mps2", "f3_mps2")
GERMAN = ("Nr.", "Zeit [s]", "Außenwinkel [°]", "Innenwinkel [°]", "ax [g]", "ay [g]", "az [g]")
PLAIN = ("No", "t [s]", "alpha [deg]", "beta [deg]", "acc x [m/s²]", "acc y [m/s²]", "acc z [m/s²]")


def position_files(bench: Bench) -> list[LabFile]:
    """CSV dialects of a position record."""
    b, files = bench, []
    n = len(b.time)

    def add(name: str, content: bytes, **more: object) -> None:
        files.append(LabFile(name, content, **more))  # type: ignore[arg-type]

    comma = bench_columns(b, mark=",")
    point = bench_columns(b)
    in_g = bench_columns(b, scale=1.0 / G, decimals=11)
    german = bench_columns(b, scale=1.0 / G, decimals=11, mark=",")
    head = ["Kalibrierung Drehtisch", "Seriennummer: A-0017", "Prüfer: Jürgen Groß", "Datum: 17.03.2026", ""]
    kept = {"Seriennummer": "A-0017", "Prüfer": "Jürgen Groß", "Datum": "17.03.2026"}

    add("semicolon, decimal comma", table(OWN, comma, sep=";"))
    add("tab, decimal comma", table(OWN, comma, sep="\t"), suffix=".txt")
    add("tab, decimal point", table(OWN, point, sep="\t"), suffix=".dat")
    add("bar", table(OWN, point, sep="|"))
    add("blanks", table(OWN, point, sep="   "), suffix=".txt")
    add("German Windows", table(GERMAN, german, sep=";", before=head, end="\r\n", encoding="cp1252"), keeps=kept)
    add("German, UTF-8 with mark", table(GERMAN, german, sep=";", before=head, encoding="utf-8-sig"), keeps=kept)
    add("German, UTF-16", table(GERMAN, german, sep="\t", before=head, end="\r\n", encoding="utf-16"), keeps=kept)
    add("sep= of Excel", table(OWN, comma, sep=";", before=["sep=;"], end="\r\n"))
    add("trailing separators", table(OWN, comma, sep=";", trailing=";;"))
    add(
        "title padded by Excel",
        table(GERMAN, german, sep=";", before=["Messung 12;;;;;;", "Prüfer;Meier;;;;;", ";;;;;;"]),
        keeps={"Prüfer": "Meier"},
    )
    add("other names", table(PLAIN, point))
    names = ("Pos.", "Time", "Outer angle", "Inner angle", "Accel X", "Accel Y", "Accel Z")
    add("row of units", table(names, in_g, units=("-", "s", "deg", "deg", "g", "g", "g")))
    add(
        "units behind a slash",
        table(
            ("Nr", "Zeit / s", "alpha / °", "beta / °", "fx / mg", "fy / mg", "fz / mg"),
            bench_columns(b, scale=1e3 / G, decimals=8, mark=","),
            sep=";",
        ),
    )
    add(
        "micro g",
        table(
            ("pos", "t_s", "alpha_deg", "beta_deg", "a1 (µg)", "a2 (µg)", "a3 (µg)"),
            bench_columns(b, scale=1e6 / G, decimals=5),
        ),
    )
    bare = ("pos", "time [s]", "alpha [deg]", "beta [deg]", "ax", "ay", "az")
    add("g or m/s²?", table(bare, in_g), needs={"units.force": "g"}, wrong={"units.force": "m/s2"})
    add("m/s² or g?", table(bare, point), needs={"units.force": "m/s2"}, wrong={"units.force": "g"})
    no_angle = ("pos", "time [s]", "alpha", "beta", "ax [g]", "ay [g]", "az [g]")
    add("degrees or radians?", table(no_angle, in_g), needs={"units.angle": "deg"})
    radians = [*in_g[:2], numbers(np.radians(b.alpha), 8), numbers(np.radians(b.beta), 8), *in_g[4:]]
    add("radians or degrees?", table(no_angle, radians), needs={"units.angle": "rad"})
    add("radians said", table(("pos", "time [s]", "alpha [rad]", "beta [rad]", "ax [g]", "ay [g]", "az [g]"), radians))
    add(
        "Grad",
        table(("Nr", "Zeit [s]", "alpha [Grad]", "beta [Grad]", "ax [g]", "ay [g]", "az [g]"), german, sep=";"),
        needs={"units.angle": "deg"},
    )
    volts = bench_columns(b, scale=0.25 / G, decimals=11)
    in_volts = ("pos", "time [s]", "alpha [deg]", "beta [deg]", "ax [V]", "ay [V]", "az [V]")
    add("volts", table(in_volts, volts), needs={"units.force": "0.25 V/g"})
    counts = bench_columns(b, scale=1e7 / G, decimals=2)
    in_counts = [name.replace("[V]", "[counts]") for name in in_volts]
    add("counts", table(in_counts, counts), needs={"units.force": "10000000 counts/g"})
    turned = [
        *in_g[:2],
        numbers((b.alpha + 180.0) % 360.0 - 180.0, 4),
        numbers((b.beta + 180.0) % 360.0 - 180.0, 4),
        *in_g[4:],
    ]
    add("angles within 180", table(PLAIN, [*turned[:4], *point[4:]]))
    arcs = [[arc(a) for a in angle] for angle in (b.alpha, b.beta)]
    no_unit = ("No", "t [s]", "alpha", "beta", *PLAIN[4:])
    add("sexagesimal", table(no_unit, [*point[:2], *arcs, *point[4:]]))
    arcs = [[arc(a, ",", "{s}{d}:{m:02d}:{t}") for a in angle] for angle in (b.alpha, b.beta)]
    add("sexagesimal with colons", table(no_unit, [*comma[:2], *arcs, *comma[4:]], sep=";"))
    times = [[clock(t, "%H:%M:%S.%f") for t in b.time]]
    add("times of day", table(("No", "Time of day", *PLAIN[2:]), [point[0], *times, *point[2:]]))
    iso = [clock(t, "%Y-%m-%dT%H:%M:%S.%f") for t in b.time]
    add("ISO dates", table(("No", "Timestamp", *PLAIN[2:]), [point[0], iso, *point[2:]]))
    days = [clock(t, "%d.%m.%Y") for t in b.time]
    hours = [clock(t, "%H:%M:%S,%f") for t in b.time]
    add(
        "date and time of one day",
        table(("Nr", "Datum", "Uhrzeit", *GERMAN[2:]), [german[0], days, hours, *german[2:]], sep=";"),
    )
    early = [(datetime(2026, 2, 1) + timedelta(days=k)).strftime("%d.%m.%Y") + " 10:00:00" for k in range(min(n, 12))]
    some = np.arange(len(early))
    short = [column[: len(early)] for column in comma]
    add(
        "1 February or 2 January?",
        table(("Nr", "Datum/Zeit", *GERMAN[2:4], *PLAIN[4:]), [short[0], early, *short[2:]], sep=";"),
        needs={"dates": "day-first"},
        wrong={"dates": "month-first"},
        rows=some,
    )
    minutes = [f"{int(t) // 60:02d}:{int(t) % 60:02d}" for t in b.time]
    add("hours or minutes?", table(("No", "Time", *PLAIN[2:]), [point[0], minutes, *point[2:]]), needs={"clock": "m:s"})
    unnamed = ("No", "Time", *PLAIN[2:])
    ms = [point[0], [f"{t * 1e3:.0f}" for t in b.time], *point[2:]]
    add("unit of time?", table(unnamed, ms), needs={"units.time": "ms"})
    add("milliseconds said", table(("No", "Time [ms]", *PLAIN[2:]), ms))
    add("no time", table((PLAIN[0], *PLAIN[2:]), [point[0], *point[2:]]), needs={"time": "order"})
    grouped = np.flatnonzero(np.abs(b.force).min(axis=1) > 0.02 * G)
    three = [
        [str(k + 1) for k in range(len(grouped))],
        [f"{t:.0f}" for t in b.time[grouped]],
        [f"{a:.0f}" for a in b.alpha[grouped]],
        [f"{a:.0f}" for a in b.beta[grouped]],
        *(numbers(1e3 * b.force[grouped, axis] / G, 3, ",") for axis in range(3)),
    ]
    milli = (*PLAIN[:4], "fx [mg]", "fy [mg]", "fz [mg]")
    add(
        "1,234: a comma between digits of all numbers",
        table(milli, three, sep=";"),
        needs={"decimal": ","},
        wrong={"decimal": "."},
        rows=grouped,
        grain=0.5e-6 * G,
    )
    three = [[text.replace(",", ".") for text in column] for column in three]
    add(
        "1.234: a point between digits of all numbers",
        table(milli, three, sep=";"),
        needs={"decimal": "."},
        wrong={"decimal": ","},
        rows=grouped,
        grain=0.5e-6 * G,
    )
    thousands = bench_columns(b, scale=1e6 / G, decimals=0)
    thousands = [*thousands[:4], *([f'"{int(v):,}"' for v in column] for column in thousands[4:])]
    add(
        "1,234 beside 20.0",
        table(("pos", "t_s", "alpha_deg", "beta_deg", "a1 [µg]", "a2 [µg]", "a3 [µg]"), thousands),
        needs={"thousands": ","} if not any(v.count(",") > 1 for column in thousands[4:] for v in column) else {},
        grain=0.5e-6 * G,
    )
    axes = ("No", "t [s]", "Axis 1 [deg]", "Axis 2 [deg]", *PLAIN[4:])
    add(
        "which axis is which?",
        table(axes, point),
        needs={"columns.alpha_deg": "Axis 1 [deg]", "columns.beta_deg": "Axis 2 [deg]"},
    )
    add(
        "no names",
        table(point[0][:0], [], before=[",".join(row) for row in zip(*point, strict=True)]),
        needs={
            "kind": "position record",
            "columns.alpha_deg": "3",
            "columns.beta_deg": "4",
            "columns.f1_mps2": "5",
            "columns.f2_mps2": "6",
            "columns.f3_mps2": "7",
            "time": "order",
            "units.angle": "deg",
            "units.force": "m/s2",
        },
        rounds=2,
    )
    hole = [list(column) for column in comma]
    hole[4][3], hole[5][6] = "n/a", ""
    keep = [k for k in range(n) if k not in (3, 6)]
    add("n/a and empty cells", table(OWN, hole, sep=";"), rows=np.array(keep))
    words = [list(column) for column in point]
    words[4][3] = "OVL"
    add("OVL", table(OWN, words), needs={"missing": "OVL"}, rows=np.array([k for k in range(n) if k != 3]))
    add(
        "footer",
        table(GERMAN, german, sep=";", after=["", "Ende der Messung", "Bemerkung: keine"]),
        keeps={"Bemerkung": "keine"},
    )
    warm = [*point, numbers(b.temperature, 4), ["ok"] * n]
    add("temperature in °C", table((*PLAIN, "Temp [°C]", "Remark"), warm))
    fahrenheit = [*point, numbers(b.temperature * 1.8 + 32.0, 4)]
    add("temperature in °F", table((*PLAIN, "Temperature (°F)"), fahrenheit))
    kelvin = [*comma, numbers(b.temperature + 273.15, 4, ",")]
    add("temperature in K", table((*GERMAN[:4], *PLAIN[4:], "Temperatur [K]"), kelvin, sep=";"))
    quoted = ['"' + text.replace('"', '""') + '"' for text in PLAIN]
    add("everything quoted", table(quoted, [[f'"{text}"' for text in column] for column in point]))
    add("quoted decimal commas", table(PLAIN, [[f'"{text}"' for text in column] for column in comma]))
    add(
        "units in the cells",
        table(
            ("No", "t", "alpha", "beta", "ax", "ay", "az"),
            [
                point[0],
                [f"{t} s" for t in point[1]],
                *([f"{a}°" for a in column] for column in point[2:4]),
                *([f"{v} m/s²" for v in column] for column in point[4:]),
            ],
        ),
    )
    swiss = bench_columns(b, scale=1e6 / G, decimals=5)
    grouped = [[f"{float(v):,.5f}".replace(",", "'") for v in column] for column in swiss[4:]]
    add(
        "apostrophes between thousands",
        table(("pos", "t_s", "alpha_deg", "beta_deg", "a1 [µg]", "a2 [µg]", "a3 [µg]"), [*swiss[:4], *grouped]),
    )
    grouped = [
        [f"{float(v):,.5f}".replace(",", "_").replace(".", ",").replace("_", ".") for v in column]
        for column in swiss[4:]
    ]
    add(
        "points between thousands",
        table(
            ("pos", "t_s", "alpha_deg", "beta_deg", "a1 [µg]", "a2 [µg]", "a3 [µg]"),
            [*bench_columns(b, mark=",")[:4], *grouped],
            sep=";",
        ),
    )
    lines = table(PLAIN, point, before=["Serial number,SN 4711", "Bench,T2", "Operator,Ann Lee"])
    add("head of cells", lines, keeps={"Serial number": "SN 4711", "Bench": "T2", "Operator": "Ann Lee"})
    return files


def repeated_file(bench: Bench, readings: int, scatter: float, seed: int, *, numbered: bool = True) -> LabFile:
    """Several readings at every position, with noise of that standard deviation [m/s²]."""
    random = np.random.default_rng(seed)
    noise = random.normal(0.0, scatter, (len(bench.time), readings, 3))
    rows = [
        [
            str(k + 1),
            f"{bench.time[k] + j:.1f}",
            f"{bench.alpha[k]:.4f}",
            f"{bench.beta[k]:.4f}",
            *(f"{bench.force[k, axis] + noise[k, j, axis]:.9f}" for axis in range(3)),
        ]
        for k in range(len(bench.time))
        for j in range(readings)
    ]
    names, columns = PLAIN, list(zip(*rows, strict=True))
    if not numbered:
        names, columns = PLAIN[1:], columns[1:]
    needs = {} if numbered else {"readings": "average"}
    return LabFile(f"{readings} readings", table(names, columns), needs=needs)


@dataclass(frozen=True)
class Block:
    """A run of gyros and accelerometers: times (N,) [s], rates (N, 3) [rad/s], specific forces (N, 3) [m/s²]."""

    time: np.ndarray
    rate: np.ndarray
    force: np.ndarray


def block_columns(block: Block, rate: float, force: float, *, mark: str = ".", decimals: int = 9) -> list[list[str]]:
    """Rates and forces times a factor as texts."""
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
    """A LabVIEW measurement file; without `x` its rows have no time, only a period."""
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
    """Logs of gyros and accelerometers: counts, deg/s, g; time in ms, µs, sample numbers at a rate, of the day."""
    b, degrees = block, 180.0 / np.pi
    plain = block_columns(b, 1.0, 1.0)
    ours = block_columns(b, degrees, 1.0 / G, decimals=11)
    german = block_columns(b, degrees, 1.0 / G, mark=",", decimals=11)
    t, ms, us = numbers(b.time, 4), [f"{v * 1e3:.1f}" for v in b.time], [f"{v * 1e6:.0f}" for v in b.time]
    samples = [str(k) for k in range(len(b.time))]
    said = ["gyro x [deg/s]", "gyro y [deg/s]", "gyro z [deg/s]", "acc x [g]", "acc y [g]", "acc z [g]"]
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
        LabFile("log in ms", table(["time [ms]", *said], [ms, *ours])),
        LabFile("log in µs, German", table(["Zeit [µs]", *said], [us, *german], sep=";", encoding="cp1252")),
        LabFile(
            "log in s, SI", table(["t_s", *(f"w{k}_rad/s" for k in "xyz"), *(f"f{k}_m/s2" for k in "xyz")], [t, *plain])
        ),
        LabFile("sample numbers", table(["sample", *said], [samples, *ours]), needs={"units.time": rate}),
        LabFile("no time", table(said, ours), needs={"units.time": rate}),
        LabFile(
            "counts of both",
            table(["time [s]", *(f"{name[:6].strip()} [LSB]" for name in said)], [t, *counts]),
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
        LabFile("time of day", table(["Time", *said], [day, *ours])),
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
            table(["week", "TOW [s]", *said], [["2300"] * len(t), t, *ours]),
            needs={"columns.time_s": "TOW [s]"},
        ),
        LabFile("milliseconds as a name", table(["millis", *said], [ms, *ours])),
        LabFile("time of the epoch", table(["timestamp [s]", *said], [epoch, *ours])),
        LabFile("temperature", table(["time [s]", *said, "temp [°C]"], [t, *ours, warm])),
        LabFile(
            "quaternion",
            table(["time [s]", *said, "qw", "qx", "qy", "qz"], [t, *ours, *still]),
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
