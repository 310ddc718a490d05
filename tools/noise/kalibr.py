"""Noise densities as kalibr's imu.yaml has them."""

from dataclasses import dataclass

from ..errors import InputError
from .processes import PROCESSES, Letter, Sensor
from .result import ChannelNoise, Noise

TOPIC = "/imu0"


@dataclass(frozen=True)
class Density:
    """A continuous-time density: key and unit of kalibr, value of the worst axis, and whether it was detected."""

    key: str
    value: float
    unit: str
    detected: bool


def kalibr_densities(noise: Noise) -> list[Density]:
    """Return the densities of white noise and random walk of accelerometers, then of gyros.

    A random walk that the record does not show has its upper end: kalibr needs a number above 0.

    Raises
    ------
    InputError
        for a record without gyros
    """
    gyros, accelerometers = noise.of("gyro"), noise.of("accelerometer")
    if not gyros or not accelerometers:
        raise InputError("kalibr's imu.yaml needs gyros and accelerometers; the record of the noise has not both")
    rows: tuple[tuple[str, Letter, list[ChannelNoise], Sensor], ...] = (
        ("accelerometer_noise_density", "N", accelerometers, "accelerometer"),
        ("accelerometer_random_walk", "K", accelerometers, "accelerometer"),
        ("gyroscope_noise_density", "N", gyros, "gyro"),
        ("gyroscope_random_walk", "K", gyros, "gyro"),
    )
    densities = []
    for key, letter, channels, sensor in rows:
        value, detected = _worst(channels, letter)
        densities.append(Density(key, value, PROCESS_UNITS[sensor, letter], detected))
    return densities


def kalibr_yaml(noise: Noise) -> str:
    """Return the text of kalibr's imu.yaml: the densities of `kalibr_densities`."""
    lines = [
        f"# of {', '.join(source.record for source in noise.records)}, by trihedron {noise.trihedron}",
        "# continuous-time densities; the noise of one sample is the density times the square root of update_rate",
        f"rostopic: {TOPIC}",
        f"update_rate: {noise.rate_hz:.6g}",
    ]
    for density in kalibr_densities(noise):
        note = "" if density.detected else ", upper end: not detected"
        lines.append(f"{density.key}: {density.value:#.7g}  # {density.unit}{note}")
    return "\n".join(lines) + "\n"


PROCESS_UNITS: dict[tuple[Sensor, Letter], str] = {
    ("accelerometer", "N"): "m/s^2/sqrt(Hz)",
    ("accelerometer", "K"): "m/s^3/sqrt(Hz)",
    ("gyro", "N"): "rad/s/sqrt(Hz)",
    ("gyro", "K"): "rad/s^2/sqrt(Hz)",
}
"""Units as kalibr writes them."""


def _worst(channels: list[ChannelNoise], letter: Letter) -> tuple[float, bool]:
    """Return the largest coefficient of three channels, and whether it is detected; where it is not, its upper end."""
    detected, bounds = [], []
    for channel in channels:
        one = channel.coefficient(letter)
        if one is None or one.high is None:
            continue
        if one.estimate is not None:
            detected.append(one.estimate)
        bounds.append(one.high)
    if detected:
        return max(detected), True
    if not bounds or max(bounds) == 0.0:
        raise InputError(
            f"the record bounds no {PROCESSES[letter].names[channels[0].sensor]}; record the block at rest for an hour"
        )
    return max(bounds), False
