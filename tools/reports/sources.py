"""Provenance of pages: versions of the program and its libraries, and the publications of their methods."""

import sys
from collections.abc import Sequence
from typing import Any

from ...fmus import version
from ..document.notation import minus
from ..rounding import digits

LIBRARIES = ("numpy", "scipy", "highspy", "fmpy")


def matrix_text(matrix: Sequence[Sequence[float]]) -> str:
    """Return a matrix in a line, its rows between semicolons."""
    rows = []
    for row in matrix:
        rows.append(" ".join([digits(value, 6) for value in row]))
    return minus("; ".join(rows))


def versions() -> dict[str, object]:
    """Return the versions of the program and of its libraries."""
    major, minor, micro = sys.version_info[:3]
    computed_with = [f"Python {major}.{minor}.{micro}"]
    for name in LIBRARIES:
        computed_with.append(f"{name} {version(name)}")
    return {"trihedron": version(), "computed with": ", ".join(computed_with)}


SOURCES = {
    "guaranteed": (
        "Model of bench and block, targets, estimates: A. A. Golovan, A. I. Matasov, I. E. Tarygin. "
        "Calibration of an accelerometer block with asymmetric models of its sensors. Izvestiya RAN, Teoriya i sistemy "
        "upravleniya, 2022, no. 2, pp. 107–119 (in Russian)."
    ),
    "simplex": (
        "Linear programmes, by HiGHS: Q. Huangfu, J. A. J. Hall. Parallelizing the dual revised simplex method. "
        "Mathematical Programming Computation 10 (2018), pp. 119–142. doi 10.1007/s12532-017-0130-5."
    ),
    "chebyshev": (
        "Least largest residual, and the few readings that decide it: E. W. Cheney. Introduction to Approximation "
        "Theory. McGraw-Hill, 1966, chapter 2."
    ),
    "lawson": (
        "Sets of effects refused by weighted least squares: C. L. Lawson. Contributions to the theory of linear least "
        "maximum approximation. Thesis, University of California, Los Angeles, 1961."
    ),
    "allan": (
        "Noise from the scatter within rests: D. W. Allan. Statistics of atomic frequency standards. Proceedings "
        "of the IEEE 54 (1966), pp. 221–230. doi 10.1109/PROC.1966.4634."
    ),
    "left-out": (
        "Parts of the record left out and predicted: M. Stone. Cross-validatory choice and assessment of statistical "
        "predictions. Journal of the Royal Statistical Society B 36 (1974), pp. 111–147."
    ),
    "angles": (
        "What could be taken for what, by angles between subspaces: Å. Björck, G. H. Golub. Numerical methods for "
        "computing angles between linear subspaces. Mathematics of Computation 27 (1973), pp. 579–594."
    ),
    "gyros": (
        "Model of the gyro block: P. Groves. Principles of GNSS, inertial, and multisensor integrated navigation "
        "systems. 2nd edition, Artech House, 2013, section 4.4."
    ),
    "attitude": (
        "Attitude from increments: Yu. N. Chelnokov, S. E. Perelyaev, L. A. Chelnokova. Investigation of algorithms "
        "for the inertial orientation of a moving object. Izvestiya of Saratov University, Mathematics. Mechanics. "
        "Informatics 16 (2016), no. 1, pp. 80–95 (in Russian). doi 10.18500/1816-9791-2016-16-1-80-95."
    ),
    "norm": (
        "Accelerometers by the size of gravity at rest: J. C. Lötters, J. Schipper, P. H. Veltink, W. Olthuis, "
        "P. Bergveld. Procedure for in-use calibration of triaxial accelerometers in medical applications. Sensors and "
        "Actuators A 68 (1998), pp. 221–228."
    ),
    "shuffles": "Shuffled effects as a control: R. A. Fisher. The Design of Experiments. Oliver and Boyd, 1935.",
    "fmi": (
        "Simulation by FMUs: Modelica Association. Functional Mock-up Interface for Model Exchange and "
        "Co-Simulation, version 2.0. 2014."
    ),
    "columns": (
        "Optimal plans by generated columns: P. C. Gilmore, R. E. Gomory. A linear programming approach to the "
        "cutting-stock problem. Operations Research 9 (1961), pp. 849–859. doi 10.1287/opre.9.6.849."
    ),
    "branches": (
        "Proof that no plan is better: A. H. Land, A. G. Doig. An automatic method of solving discrete programming "
        "problems. Econometrica 28 (1960), pp. 497–520. doi 10.2307/1910129."
    ),
}
"""Methods, each with its use here and its publication."""


def cited(*names: str | Any) -> list[str]:
    """Return the sources of some methods; false names are skipped."""
    return [SOURCES[name] for name in names if name]
