"""The four case studies of measured records: pages and pictures whose every number comes from the records.

Run by ``python docs/builders/case_studies.py DATA DOCS``: DATA is the folder with the records, DOCS the
folder that gets the pages and, in ``pictures``, the pictures.
"""

import math
import sys
from collections.abc import Sequence
from pathlib import Path

import numpy as np

import broad_four
from trihedron.tools.cli.answer import exit_status
from trihedron.tools.diagnosis import Diagnosis, diagnose
from trihedron.tools.diagnosis.cause import Cause
from trihedron.tools.diagnosis.result import OrderOfEffects
from trihedron.tools.errors import InputError
from trihedron.tools.files import write_text
from trihedron.tools.records import StrapdownRecord, read_record
from trihedron.tools.rounding import digits, interval, residual, upwards

BROAD = "broad-03"
MPU = ("mpu9150-0", "mpu9150-1", "mpu9150-2")
XSENS = "xsens-imu-tk"
CAPTIONS = {
    "time": "Error of the carried attitude over time.",
    "quantities": "The same errors against possible causes.",
    "order": "Errors of left-out parts, effect after effect.",
    "gain": "Unused parts of the record, without and with the effects.",
}


def read(folder: Path, name: str) -> StrapdownRecord:
    """Return one of the records.

    Raises InputError if it is missing.
    """
    path = folder / f"{name}.strapdown.csv"
    if not path.exists():
        raise InputError(f"{path}: is not there; the case studies need the measured records")
    record = read_record(path)
    assert isinstance(record, StrapdownRecord)
    return record


def table(header: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """Return a table in Markdown."""
    lines = ["| " + " | ".join(header) + " |", "|" + "---|" * len(header)]
    return "\n".join(lines + ["| " + " | ".join(str(cell) for cell in row) + " |" for row in rows])


def order_text(order: OrderOfEffects | None) -> str:
    """Return an order of effects with the remaining errors, arcminutes."""
    if order is None:
        return "–"
    steps = [f"{step.effect} → {digits(step.held_out_rms_arcmin)}" for step in order.steps]
    return f"{digits(order.held_out_rms_arcmin)}: " + (", ".join(steps) or "nothing helps")


def picture_lines(written: Sequence[Path], stem: str) -> str:
    """Return the pictures with their captions."""
    names = [path.stem.removeprefix(f"{stem}-") for path in written]
    return "\n\n".join(
        f"![{name}](pictures/{path.name})\n\n*{CAPTIONS[name]}*" for name, path in zip(names, written, strict=True)
    )


def gain_table(result: Diagnosis) -> str:
    """Return the errors of unused parts."""
    assert result.gain is not None
    summary = result.gain.to_json()
    rows = [
        [
            row["over"],
            row["pieces"],
            *(digits(row[f"held_out_rms_{when}"]) for when in ("before", "after")),
            *(upwards(row[f"held_out_max_{when}"], 3) for when in ("before", "after")),
        ]
        for row in [summary, *summary["others"]]
    ]
    return table(["over", "pieces", "rms before", "rms after", "largest before", "largest after"], rows)


def excluded_table(result: Diagnosis) -> str:
    """Return the largest size of each effect of the gyros that the record leaves possible."""
    largest: dict[tuple[str, str], float] = {}
    for entry in result.excluded or ():
        if entry["where"] in ("gyro-block", "attitude-computer"):
            key = (entry["effect"], entry["unit"])
            largest[key] = max(largest.get(key, 0.0), entry["above"])
    rows = [[effect, upwards(above), "" if unit == "1" else unit] for (effect, unit), above in largest.items()]
    return table(["effect", "excluded above", "unit"], rows)


def left_over(result: Diagnosis, helps: str) -> str:
    """Return the remaining errors at each length after the helpful effects, and the cause of their growth."""
    lengths = [length for length in result.lengths or () if length.order is not None and length.order.steps]
    remaining = [length.order.steps[-1].held_out_rms_arcmin for length in lengths if length.order is not None]
    seconds = [float(length.over.split()[0]) for length in lengths]
    ratio, times = remaining[-1] / remaining[0], seconds[-1] / seconds[0]
    listed = ", ".join(f"{digits(rms)} over {length.over}" for rms, length in zip(remaining, lengths, strict=True))
    slow = "So errors that add up in time dominate."
    if ratio < math.sqrt(times):
        slow = "So errors at the ends dominate short windows:\nlook first at the cameras in motion."
    grown, longer, root = (digits(value, 2) for value in (ratio, times, math.sqrt(times)))
    return f"""Remaining errors with {helps}, rms in arcminutes:
{listed}. They grow by a factor of {grown}
while the windows grow by {longer}. Errors of the cameras at both ends of a window, or a lag, would not grow. Noise of
the gyros would grow by {root}, a wrong rate by {longer}. {slow}"""


def stated_bounds(result: Diagnosis) -> list[float]:
    """Return the bounds of the cameras' error to try: the need of all effects, that of the helpful ones, and a fifth
    more."""
    sources, lengths = result.sources, result.lengths or ()
    order = lengths[len(lengths) // 2].order
    chosen = () if order is None else tuple(step.place for step in order.steps)
    every, helping = (float(upwards(sources.needed(places), 3)) for places in (sources.rows.places, chosen))
    return [every, helping, float(upwards(1.2 * helping, 3))]


def sets_of(result: Diagnosis) -> list[Sequence[Cause]]:
    """Return the remaining sets, the best first."""
    return list(result.sets)


def stated_text(stated: Sequence[Diagnosis]) -> str:
    """Return the causes for each assumed error of the cameras."""
    rows = [
        [
            digits(diagnosis.reference_bound_arcmin),
            upwards(diagnosis.noise_bound_arcmin, 3),
            diagnosis.verdict,
            "; ".join(
                [" + ".join(cause.effect for cause in causes) for causes in sets_of(diagnosis)]
                + ["others may: the search was cut off"] * (diagnosis.cut_off_at is not None)
            )
            or "none",
        ]
        for diagnosis in stated
    ]
    return table(["stated [arcmin at a row]", "bound [arcmin]", "verdict", "sets"], rows)


def broad_page(result: Diagnosis, stated: Sequence[Diagnosis], pictures: str) -> str:
    """Return the case study of BROAD 03: without a bound of the cameras' error, and with several."""
    inspection = result.sources.found
    record = inspection.record
    period = inspection.sampling.period
    middle = (result.lengths or ())[len(result.lengths or ()) // 2]
    steps = middle.order.steps if middle.order is not None else ()
    helps = " and ".join(step.effect for step in steps) or "nothing"
    bias = (
        ", ".join(digits(math.degrees(value)) for value in result.bias_at_rest.radps)
        if result.bias_at_rest is not None
        else ""
    )
    left_in = digits((result.bias_at_rest and result.bias_at_rest.rms_if_left_in_arcmin) or 0.0)
    stable = "the same at every length" if result.order_stable else "not stable over the lengths"
    quoted = result.gain.to_json() if result.gain is not None else {}
    ends = (quoted.get(f"held_out_rms_{when}", math.nan) for when in ("before", "after"))
    fall = f"{' to '.join(digits(end) for end in ends)} arcmin rms"
    return f"""# Case study: BROAD 03, a strapdown unit before cameras

The record has {len(record)} rows, one every {digits(1e3 * period, 4)} ms: {digits(float(np.ptp(record.time_s)))} s of
slow rotation by hand between two rests. Cameras give the true attitude. `make case-studies` writes every number of the
case studies.

**{result.verdict.capitalize()}. Of all effects {helps} help most: over windows of
{quoted.get("over", "")} that were not used, the error falls from {fall}. Noise and the cameras at rest do not explain
the remainder, so the diagnosis names no effect.**

## Remaining errors

{left_over(result, helps)}

The nominal block leaves at least {residual(result.radius)} bounds. It subtracts the gyros' mean at rest, ({bias})
deg/s; without that the errors would be {left_in} arcmin rms.

## With the cameras' error stated

The table has the smallest [`--reference-bound`](strapdown-diagnosis.md#a-true-attitude-that-errs-in-motion) with which
all effects together suffice, the smallest for {helps}, and a fifth more.

{stated_text(stated)}

## Pictures

The order in which effects help is {stable}.

{pictures}

## Gain

The exported FMUs with {helps}, with parameters from other parts of the record
[arcmin]:

{gain_table(result) if result.gain is not None else ""}

Data: D. Laidig, M. Caruso, A. Cereatti, T. Seel, "BROAD - A Benchmark for Robust Inertial Orientation Estimation",
Data 6(7):72, 2021, trial 03, CC BY 4.0; other file format, magnetometer and position left out.
"""


def mpu_page(results: Sequence[Diagnosis], nominal: Sequence[Diagnosis], pictures: str) -> str:
    """Return the case study of the three MPU-9150 logs."""
    names = [r.sources.found.record.path.name.removesuffix(".strapdown.csv") for r in results]
    rows = [
        [
            name,
            r.verdict,
            len(r.sources.found.rests),
            length.pieces,
            digits(length.rms_arcmin),
            upwards(r.noise_bound_arcmin, 3),
            residual(r.radius),
        ]
        for name, r in zip(names, results, strict=True)
        for length in (r.lengths or ())[:1]
    ]
    compared = [
        [
            name,
            n.verdict,
            residual(n.radius),
            " or ".join(" + ".join(c.place.effect for c in causes) for causes in n.sets),
            f"{digits(n.lengths[0].order.held_out_rms_arcmin)} → "
            f"{digits(n.lengths[0].order.steps[0].held_out_rms_arcmin)}"
            if n.lengths and n.lengths[0].order is not None and n.lengths[0].order.steps
            else "–",
        ]
        for name, n in zip(names, nominal, strict=True)
    ]
    hertz = 1.0 / results[0].sources.found.sampling.period
    verdicts = ", ".join(f"{name} {r.verdict}" for name, r in zip(names, results, strict=True))
    causes = [cause.place.effect for r in results for cause in r.causes]
    naming = f"Named: {', '.join(causes)}" if causes else "The diagnosis names no effect"
    return f"""# Case study: three MPU-9150 logs, no angles known

A hand moved three specimens of a MEMS unit from rest to rest, at {digits(hertz)} Hz. No pose is known, and
[gravity is the reference](strapdown-diagnosis.md#comparison).

**{verdicts}. {naming}.**

{table(["log", "verdict", "rests", "moves", "rms error of a move [arcmin]", "bound [arcmin]", "radius"], rows)}

{pictures}

## Value of the gyros' calibration

Scale factors and misalignments of the gyros are zero here (`--baseline nominal`). The last column is the rms error of a
left-out move, without and with the most helpful effect [arcmin].

{table(["log", "verdict", "radius", "helpful effect", "left out"], compared)}

## Excluded effects

Larger sizes than these contradict {names[0]}:

{excluded_table(results[0])}

Data: github.com/mikoff/imu-calib, MIT licence, (c) 2020 A. Mikov; "In-situ gyroscope calibration based on
accelerometer data", ICINS 2020; columns reordered, time added.
"""


def xsens_page(result: Diagnosis, nominal: Diagnosis, pictures: str) -> str:
    """Return the case study of the Xsens unit of imu_tk."""
    inspection = result.sources.found
    record, rests = inspection.record, inspection.rests
    lengths = result.lengths or ()
    (cause,) = result.causes
    at_rest = (
        next((m for m in inspection.gyros.tried if m.terms == ("gravity",)), None)
        if inspection.gyros is not None
        else None
    )
    sizes = []
    for number, (p, ends) in enumerate(zip(cause.parameters, cause.intervals, strict=True)):
        axis, by = divmod(number, 3)
        if ends[0] <= 0.0 <= ends[1]:
            continue
        at_means = "–" if at_rest is None else digits(at_rest.coefficients[axis][1 + by], 2)
        sizes.append([p.name, *interval(p.estimate, *ends), at_means, p.unit])
    zero = sum(low > 0.0 or high < 0.0 for low, high in cause.intervals)
    rows = [
        [
            length.over,
            length.pieces,
            digits(length.rms_arcmin),
            upwards(length.noise_bound_arcmin, 3),
            residual(length.radius),
            order_text(length.order),
        ]
        for length in lengths
    ]
    rivals = [[name, residual(radius)] for name, radius in result.tried[:2]]
    assert isinstance(result.judgement, tuple)
    witness = result.judgement[0]
    quoted = result.gain.to_json() if result.gain is not None else {}
    before, after = (digits(quoted.get(f"held_out_rms_{when}", math.nan)) for when in ("before", "after"))
    model = "The gyros' means at rest were not judged"
    if inspection.gyros is not None:
        radii = "; ".join(f"{m.title}, radius {residual(m.radius)}" for m in inspection.gyros.tried)
        standing = " or ".join(m.title for m in inspection.gyros.standing) or inspection.gyros.verdict
        model = f"By the means at rest alone the gyros are {standing} ({radii})"
    hertz, seconds = digits(1.0 / inspection.sampling.period), digits(float(np.ptp(record.time_s)))
    header = ["over", "pieces", "rms [arcmin]", "bound [arcmin]", "radius", "left out, effect after effect [arcmin]"]
    causes = " + ".join(c.effect for c in result.causes) or "nothing"
    nominal_causes = " + ".join(c.effect for c in nominal.causes) or "nothing"
    fall = f"{digits(witness.rms_without)} to {digits(witness.rms_with)}"
    return f"""# Case study: an Xsens unit whose gyros feel gravity

A hand moved one unit between {len(rests)} rests in {seconds} s, at {hertz} Hz. No pose is known. It is the test record
of a published calibration, whose model has biases, scale factors and misalignments.

**{result.verdict.capitalize()}: {causes}. Over single moves that were not used the error falls
from {before} to {after} arcmin rms.**

## Misfit of the published model

[Gravity is the reference](strapdown-diagnosis.md#comparison). The best block without the effect leaves an error of
{residual(result.radius)} bounds. Over one, two and three moves together:

{table(header, rows)}

## The effect

{rivals[0][0]} leaves a radius of {rivals[0][1]}, the next best effect, {rivals[1][0]}, {rivals[1][1]}.

So the biases of the gyros depend on the specific force: ω read = ω + b + G f. Of the nine coefficients these
{zero} cannot be zero. Intervals come from moves and rests, the column "at rest" from the means at rest alone
(`trihedron inspect`).

{table(["coefficient", "estimate", "low", "high", "at rest", "unit"], sizes)}

{model}.
Of left-out parts the error, in bounds, falls from {fall}. Of {witness.shuffles.tried} shuffles of the effect
{witness.shuffles.as_good} do as well.

{pictures}

With scale factors and misalignments of the gyros held at zero (`--baseline nominal`) the radius is
{residual(nominal.radius)}: {nominal.verdict} by {nominal_causes}.

Data: github.com/Kyle-ak/imu_tk, two-clause BSD licence, (c) 2014 A. Pretto; D. Tedaldi, A. Pretto, E. Menegatti, "A
robust and easy to implement method for IMU calibration without external equipments", ICRA 2014. Counts were converted
with the factory's nominal values; the stamps are as logged, and jitter.
"""


def write_pictures(result: Diagnosis, folder: Path, stem: str) -> list[Path]:
    """Write the pictures of a carried block's errors as <stem>-<name>.svg into a folder; return the files."""
    from trihedron.tools.reports import evidence
    from trihedron.tools.reports.pictures.residuals import order_picture, shares_of_pieces

    found, orders = evidence.error_pictures(result), evidence.orders_of(result)
    if orders:
        found["order"] = order_picture(orders)
    if result.gain is not None:
        found["gain"] = shares_of_pieces(result.gain.before, result.gain.after, result.gain.over or "")
    for name, picture in found.items():
        write_text(folder / f"{stem}-{name}.svg", picture.svg())
    return [folder / f"{stem}-{name}.svg" for name in found]


def write_broad(data: Path, docs: Path) -> None:
    """Write the page and the pictures of BROAD 03."""
    record = read(data, BROAD)
    result = diagnose(record)
    stated = [diagnose(record, reference_bound=bound) for bound in stated_bounds(result)]
    written = write_pictures(result, docs / "pictures", "broad")
    write_text(docs / "case-study-broad.md", broad_page(result, stated, picture_lines(written, "broad")))


def write_mpu(data: Path, docs: Path) -> None:
    """Write the page and the pictures of the three MPU-9150 logs."""
    records = [read(data, name) for name in MPU]
    results = [diagnose(record, rerun=False) for record in records]
    nominal = [diagnose(record, baseline="nominal", rerun=False) for record in records]
    written = write_pictures(results[0], docs / "pictures", "mpu9150")
    write_text(docs / "case-study-mpu9150.md", mpu_page(results, nominal, picture_lines(written, "mpu9150")))


def write_xsens(data: Path, docs: Path) -> None:
    """Write the page and the pictures of the Xsens unit."""
    record = read(data, XSENS)
    result, nominal = diagnose(record), diagnose(record, baseline="nominal", rerun=False)
    written = write_pictures(result, docs / "pictures", "xsens")
    write_text(docs / "case-study-xsens.md", xsens_page(result, nominal, picture_lines(written, "xsens")))


def main(arguments: Sequence[str]) -> int:
    """Write the case studies."""
    if len(arguments) != 2:
        print("usage: python docs/builders/case_studies.py DATA DOCS", file=sys.stderr)
        return 2
    data, docs = (Path(argument) for argument in arguments)

    def write() -> int:
        (docs / "pictures").mkdir(parents=True, exist_ok=True)
        write_broad(data, docs)
        write_mpu(data, docs)
        write_xsens(data, docs)
        broad_four.write_page({name: read(data, f"broad-{name}") for name in broad_four.RECORDS}, docs)
        return 0

    return exit_status(write)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
