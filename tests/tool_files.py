"""Files as other tools write them: their names, units and lines above, over one motion of our own, every 10 ms."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import numpy as np

G = 9.80665
COUNT = 60
RNG = np.random.default_rng(47)
TIME = np.round(0.01 * np.arange(COUNT), 2)
TURN = 0.9 * np.sin(0.7 * TIME) + 0.3
FORCE = G * np.stack([np.sin(TURN), 0.05 + 0.0 * TURN, np.cos(TURN)], axis=1)
FORCE = np.round(FORCE + RNG.normal(0.0, 0.03, (COUNT, 3)), 6)
RATE = np.round(np.stack([0.02 + 0.0 * TURN, 0.63 * np.cos(0.7 * TIME), -0.2 * np.sin(0.4 * TIME)], axis=1), 6)
MILLI_G, IN_G, DEGREES = np.round(1e3 * FORCE / G, 4), np.round(FORCE / G, 7), np.round(np.degrees(RATE), 5)
OTHER = np.round(RNG.normal(0.0, 30.0, (COUNT, 3)), 3)
MICROS = 5_000_000 + 10_000 * np.arange(COUNT)
MILLIS = MICROS // 1000
NANOS = 1_700_000_000_000_000_000 + 10_000_000 * np.arange(COUNT)
ZERO = [0] * COUNT
XYZ, LOWER = "XYZ", "xyz"


@dataclass(frozen=True)
class ToolFile:
    """A file's text, the answers to its only round of questions, and whether it has accelerometers alone."""

    text: str
    answers: dict[str, str] = field(default_factory=dict)
    alone: bool = False


def named(pattern: str, axes: Iterable[str] = XYZ) -> list[str]:
    """Return the names of three columns."""
    return [pattern.format(axis) for axis in axes]


def clock(form: str) -> list[str]:
    """Return the times of the rows on 17 March 2026 in the form of strftime."""
    start = datetime(2026, 3, 17, 10, 15)
    return [(start + timedelta(milliseconds=10 * k)).strftime(form) for k in range(COUNT)]


def table(names: Sequence[str], columns: Sequence[Iterable[object]], mark: str = ",", above: str = "") -> str:
    """Return a text of lines above, names and rows; an array (N, 3) gives three columns."""
    flat: list[Iterable[object]] = []
    for column in columns:
        flat += column.T.tolist() if isinstance(column, np.ndarray) and column.ndim == 2 else [column]
    rows = [mark.join(map(str, row)) for row in zip(*flat, strict=True)]
    return "\n".join([f"{above}{mark.join(names)}", *rows])


def units(force: str = "", rate: str = "", time: str = "", **further: str) -> dict[str, str]:
    """Return answers about units."""
    answers = {"units.force": force, "units.rate": rate, "units.time": time} | further
    return {key: text for key, text in answers.items() if text}


SI = units("m/s2", "rad/s")
FILES = {
    "Shimmer Consensys": ToolFile(
        table(
            ["S_5E4D_Timestamp_Unix_CAL", *named("S_5E4D_Accel_LN_{}_CAL"), *named("S_5E4D_Gyro_{}_CAL")],
            [["ms", *(f"{time / 1e6:.3f}" for time in NANOS.tolist())]]
            + [["m/(s^2)", *column] for column in FORCE.T.tolist()]
            + [["deg/s", *column] for column in DEGREES.T.tolist()],
            "\t",
            '"sep=\t"\n',
        )
    ),
    "Movella DOT": ToolFile(
        table(
            ["PacketCounter", "SampleTimeFine", *named("Euler_{}"), *named("Acc_{}"), *named("Gyr_{}")],
            [range(COUNT), MICROS, OTHER, FORCE, DEGREES],
            above="sep=,\nDeviceTag:,DOT1\nFirmwareVersion:,2.2.1\nOutputRate:,100Hz\n\n",
        )
    ),
    "ST Unico": ToolFile(
        table(
            ["timestamp [us]", *named("A_{} [mg]", LOWER), *named("G_{} [mdps]", LOWER)],
            [MICROS, MILLI_G, np.round(1e3 * DEGREES, 2)],
            "\t",
        )
    ),
    "Arduino with an LSM6": ToolFile(
        table(
            ["millis", "ax", "ay", "az", "gx", "gy", "gz"],
            [MILLIS, np.round(FORCE * 1e6).astype(int), np.round(DEGREES * 1e5).astype(int)],
        ),
        units("1e-6 m/s2/LSB", "0.00001 deg/s/LSB"),
    ),
    "GoPro telemetry": ToolFile(
        table(
            ["cts", "date", *named("Accelerometer ({}) [m/s²]", "zxy"), "temperature [°C]"],
            [1e3 * TIME, clock("%Y-%m-%dT%H:%M:%S.%f"), FORCE[:, [2, 0, 1]], [31.0] * COUNT],
        ),
        alone=True,
    ),
    "u-blox ESF-RAW": ToolFile(
        table(["iTOW", *named("gyro{}"), *named("accel{}")], [300_000_000 + MILLIS, DEGREES, FORCE]),
        units("m/s2", "deg/s", "ms"),
    ),
    "Movesense": ToolFile(
        table(["timestamp", "x", "y", "z"], [MILLIS, FORCE]),
        units("m/s2", time="ms") | {"columns.force": "x,y,z"},
        alone=True,
    ),
    "OpenLog Artemis": ToolFile(
        table(
            ["rtcDate", "rtcTime", "aX", "aY", "aZ", "gX", "gY", "gZ", "imu_degC", "output_Hz"],
            [clock("%m/%d/%Y"), clock("%H:%M:%S.%f"), MILLI_G, DEGREES, [25.1] * COUNT, [100.0] * COUNT],
        ),
        units("mg", "deg/s"),
    ),
    "BNO055": ToolFile(
        table(
            [
                "time_ms",
                *named("acc_{}", LOWER),
                *named("lin_{}", LOWER),
                *named("grav_{}", LOWER),
                *named("gyr_{}", LOWER),
            ],
            [MILLIS, FORCE, 0.1 * RATE, FORCE, DEGREES],
        ),
        units("m/s2", "deg/s"),
    ),
    "rows of an Android phone": ToolFile(
        table(
            ["elapsedRealtimeNanos", "sensor", "x", "y", "z"],
            [
                np.repeat(NANOS, 2),
                ["accelerometer", "gyroscope"] * COUNT,
                np.stack([FORCE, RATE], axis=1).reshape(-1, 3),
            ],
        ),
        units("m/s2", "rad/s") | {"part": "sensor=accelerometer,sensor=gyroscope"},
    ),
    "Crossbow": ToolFile(
        table(
            ["Time (s)", "RollRate", "PitchRate", "YawRate", *named("{}Accel")],
            [TIME, DEGREES, IN_G],
        ),
        units("g", "deg/s"),
    ),
    "VectorNav": ToolFile(
        table(
            ["TimeStartup", *named("UncompAccel{}"), *named("Accel{}"), *named("UncompGyro{}"), *named("Gyro{}")],
            [1000 * MICROS, FORCE + 0.1, FORCE, RATE + 0.1, RATE],
        ),
        SI | units(time="ns"),
    ),
    "SBG": ToolFile(
        table(
            [
                "time (us)",
                "status",
                *named("acc_{} (m/s^2)", LOWER),
                *named("gyro_{} (rad/s)", LOWER),
                "temp (°C)",
                *named("deltaVel_{} (m/s^2)", LOWER),
                *named("deltaAngle_{} (rad/s)", LOWER),
            ],
            [MICROS, ZERO, FORCE, RATE, [30.2] * COUNT, FORCE + 0.01, RATE + 0.01],
            "\t",
        )
    ),
    "InertialSense": ToolFile(
        table(["time", "status", *named("pqr[{}]", "012"), *named("acc[{}]", "012")], [TIME, ZERO, RATE, FORCE]),
        SI | units(time="s"),
    ),
    "a timetable of MATLAB": ToolFile(
        table(
            ["Time", *named("Accel_{}", "123"), *named("Gyro_{}", "123")],
            [[f"{time:.2f} sec" for time in TIME], FORCE, RATE],
        ),
        SI,
    ),
    "MATLAB Mobile": ToolFile(
        table(["Timestamp", "X", "Y", "Z"], [clock("%d-%b-%Y %H:%M:%S.%f"), FORCE]),
        units("m/s2") | {"columns.force": "X,Y,Z"},
        alone=True,
    ),
    "Polar": ToolFile(
        table(
            ["Phone timestamp", "sensor timestamp [ns]", *named("{} [mg]")],
            [clock("%Y-%m-%dT%H:%M:%S.%f"), NANOS, MILLI_G],
            ";",
        ),
        alone=True,
    ),
    "ActiGraph": ToolFile(
        table(
            ["Timestamp", *named("Accelerometer {}"), *named("Gyroscope {}"), *named("Magnetometer {}")],
            [clock("%Y-%m-%dT%H:%M:%S.%f0"), IN_G, DEGREES, OTHER],
            above="--- Data File Created By ActiGraph GT9X date format M/d/yyyy at 100 Hz ---\nSerial Number: TAS1\n",
        ),
        units("g", "deg/s"),
    ),
    "Axivity": ToolFile(
        table(
            [clock("%Y-%m-%d %H:%M:%S.%f")[0], *map(str, IN_G[0])],
            [clock("%Y-%m-%d %H:%M:%S.%f")[1:], IN_G[1:]],
        ),
        units("g") | {"columns.force": "2,3,4"},
        alone=True,
    ),
    "x-io": ToolFile(
        table(
            ["Timestamp (us)", *named("Gyroscope {} (deg/s)"), *named("Accelerometer {} (g)")], [MICROS, DEGREES, IN_G]
        )
    ),
    "WitMotion": ToolFile(
        table(
            ["Time(s)", "ChipTime", *named("a{}(g)", LOWER), *named("w{}(deg/s)", LOWER), *named("Angle{}(deg)")],
            [TIME, clock("%Y-%m-%d %H:%M:%S.%f"), IN_G, DEGREES, OTHER],
            "\t",
        )
    ),
    "DJI": ToolFile(
        table(["Clock:Tick#", *named("IMU_ATTI(0):accel{}"), *named("IMU_ATTI(0):gyro{}")], [MICROS, IN_G, DEGREES]),
        units("g", "deg/s", "100 Hz")
        | {
            "columns.force": ",".join(named("IMU_ATTI(0):accel{}")),
            "columns.rate": ",".join(named("IMU_ATTI(0):gyro{}")),
        },
    ),
    "PX4 sensor_accel": ToolFile(
        table(["timestamp", "device_id", "x", "y", "z"], [MICROS, [1] * COUNT, FORCE]),
        units("m/s2", time="us") | {"columns.force": "x,y,z"},
        alone=True,
    ),
    "Bosch": ToolFile(
        table(
            ["Time (us)", *named("Acc {} (LSB)"), *named("Gyr {} (LSB)")],
            [MICROS, np.round(FORCE * 1e6).astype(int), np.round(DEGREES * 1e5).astype(int)],
        ),
        units("1e-6 m/s2/LSB", "0.00001 deg/s/LSB"),
    ),
    "APDM Opal": ToolFile(
        table(
            [
                "Time",
                *named("Accelerometer {} (m/s^2)"),
                *named("Gyroscope {} (rad/s)"),
                *named("Magnetometer {} (uT)"),
            ],
            [NANOS // 1000, FORCE, RATE, OTHER],
        ),
        units(time="us"),
    ),
    "two units of one body": ToolFile(
        table(
            [
                "time_s",
                *named("left_acc_{}", LOWER),
                *named("left_gyr_{}", LOWER),
                *named("right_acc_{}", LOWER),
                *named("right_gyr_{}", LOWER),
            ],
            [TIME, FORCE, RATE, FORCE + 0.1, RATE + 0.1],
        ),
        SI
        | {
            "columns.force": ",".join(named("left_acc_{}", LOWER)),
            "columns.rate": ",".join(named("left_gyr_{}", LOWER)),
        },
    ),
    "an iPhone's SensorLog": ToolFile(
        table(
            [
                "loggingTime(txt)",
                *named("accelerometerAcceleration{}(G)"),
                *named("gyroRotation{}(rad/s)"),
                *named("motionUserAcceleration{}(G)"),
                *named("motionGravity{}(G)"),
            ],
            [clock("%Y-%m-%d %H:%M:%S.%f"), IN_G, RATE, 0.01 * IN_G, IN_G],
        )
    ),
    "a post-processed trajectory": ToolFile(
        table(
            ["GPSTime (s)", *named("Acc{} (m/s2)"), *named("Gyro{} (deg/s)"), *named("V{} (m/s)", LOWER)],
            [345600.0 + TIME, FORCE, DEGREES, OTHER],
        )
    ),
}
"""Tool -> a file that it writes."""
