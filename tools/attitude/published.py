"""The errors of attitude algorithms that were published, row by row."""

import csv
from dataclasses import dataclass
from importlib.resources import files

import numpy as np

from ...models.attitude_algorithms import ALGORITHMS, Algorithm

ALGORITHM_OF_PRINT = {
    "(7.18)": "mean-rate",
    "(7.20)": "one-sample-quaternion",
    "(7.22)": "two-sample-quaternion",
    "(19)": "one-sample-rodrigues",
    "(20)": "one-sample-rodrigues-symmetric",
    "(22)": "two-sample-rodrigues",
    "[1, p. 355]": "two-sample-textbook-as-run",
    "(24), (25)": "panov",
    "(24), remark 3": "panov-cut-off",
}
"""The algorithm that gives the published errors, for each name in print."""

ANGLES = ("ψ", "ϑ", "γ")
TABLES = {"1": "Table 1", "2": "Table 2", "3": "Table 3", "3.1.1": "section 3.1.1"}


@dataclass(frozen=True)
class PublishedRow:
    """One row: the largest errors of ψ, ϑ, γ over 600 s.

    Attributes
    ----------
    number : int
        of the row, from 1
    table : str
        key of `TABLES`
    print_name : str
        name of the algorithm in print
    step : float
        h [s]
    nodes : int
        M as printed
    motion : str
        1 to 6: variants of Table 1; small: small amplitudes; first, second: compositions of harmonics
    error_deg : tuple of float
        printed errors of ψ, ϑ, γ [deg]
    """

    number: int
    table: str
    print_name: str
    step: float
    nodes: int
    motion: str
    error_deg: tuple[float, float, float]

    @property
    def algorithm(self) -> Algorithm:
        """The algorithm that was run."""
        return algorithm_named(ALGORITHM_OF_PRINT[self.print_name])

    @property
    def error(self) -> np.ndarray:
        """Printed errors of ψ, ϑ, γ [rad]."""
        return np.radians(self.error_deg)

    @property
    def title(self) -> str:
        """The row as it is named in what people read."""
        return f"{TABLES[self.table]}, {self.print_name}, h = {self.step:g} s, M = {self.nodes}, motion {self.motion}"


def algorithm_named(name: str) -> Algorithm:
    """The algorithm of a name."""
    return next(algorithm for algorithm in ALGORITHMS if algorithm.name == name)


def published_rows() -> tuple[PublishedRow, ...]:
    """All published rows, in the order of the paper.

    Source: Chelnokov, Perelyaev, Chelnokova 2016, Tables 1 to 3, section 3.1.1.
    """
    text = files("trihedron.tools.attitude").joinpath("published_attitude.csv").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return tuple(
        PublishedRow(
            number,
            row["table"],
            row["algorithm"],
            float(row["h_s"]),
            int(row["M"]),
            row["motion"],
            (float(row["psi_deg"]), float(row["theta_deg"]), float(row["gamma_deg"])),
        )
        for number, row in enumerate(csv.DictReader(lines), start=1)
    )
