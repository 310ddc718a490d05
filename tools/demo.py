"""The whole loop in one run: simulate, calibrate, falsify, name, extend, measure the gain, show."""

import json
import math
import os
import shutil
import sys
import webbrowser
from dataclasses import replace
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from ..fmus import components, version
from ..models.bench import BIAS, GYRO_PARAMETERS, MATRIX, TARGETS, target_values
from ..models.effects import EffectPlace
from .calibrated import LATENCIES
from .calibration import Bench, Calibration, calibrate_whole
from .diagnosis import diagnose, export_extended
from .document.blocks import Page, Section
from .document.notation import sentence
from .document.page import html
from .files import make_folders, write_text
from .motion.attitude import rate_at_rest, run_attitude
from .orchestrator.run import simulate_table
from .orchestrator.scenario import Scenario, read_scenario
from .records import PositionRecord, StrapdownRecord, read_record
from .reports.bench import run_section
from .reports.beyond import sections as band_sections
from .reports.calibration import gyro_sections, target_sections
from .reports.diagnosis import answer_of, sections_of
from .reports.inspection import error_lines, run_line
from .reports.pictures.records import attitude_picture
from .rounding import digits
from .trials.bench import NOISE_BOUND, draw_whole, true_elementary
from .trials.case import Case
from .trials.draw import draw_alone
from .trials.outcome import judged_case
from .trials.sizes import Hidden
from .trials.suite import write_hidden_record

IMU_CALIBRATION = "imu-calibration.toml"
SHORTER = {
    "an hour of rests and turns at 200 Hz": "ten minutes of rests and turns at 50 Hz",
    "step_s = 0.005": "step_s = 0.02",
    "dwell_s = 62.0": "dwell_s = 6.0",
}
"""What the scenario says, and what the demonstration's says in its place."""
MEASURED_RECORD = "broad-03.strapdown.csv"
HIDDEN = (
    Hidden(EffectPlace("gyro-scale-asymmetry", "gyro-block"), (5e-4, -4e-4, 3e-4)),
    Hidden(EffectPlace("undersampling", "attitude-computer"), (0.08,)),
)
"""Effects of which one is hidden: each can be composed into an FMU, and they do not look alike."""
POSITIONS, STEP_S = 16, 0.1
"""Positions and whole turns of the record that hides it, three minutes, and how far its rows are apart [s]."""
BUMP_AT, BUMP_WIDTH, BUMP_HEIGHT = 2.0, 0.6, 2e-4
"""Where an encoder errs, how far about that, and by how much [rad]."""
VARIABLE = "TRIHEDRON_DATA"
"""Environment variable that names the folder of the measured records."""

WHERE_TO_GET = (
    "broad-03.strapdown.csv is not here: it is trial 03 (undisturbed slow rotation) of the BROAD data set, D. Laidig "
    "et al., doi 10.3390/data6070072 (github.com/dlaidig/broad, CC BY 4.0), written as a strapdown record; "
    f"put it into a folder and name that in ${VARIABLE}"
)
"""What a person reads where the record is not there."""


def run_demo(out: Path, *, seed: int, show: bool) -> Path:
    """Run the demonstration; give its page, which is in `out` with everything else that is made.

    The seed is that of the record with the hidden effect. `show`: open the page where there is a screen.
    """
    make_folders(out)
    tell(f"1  Simulate: table, accelerometers, gyros and attitude computer, at rest and turning ({IMU_CALIBRATION})")
    scenario = read_scenario(copied_scenario(out))
    files = simulate_table(scenario, out / "imu-calibration-run", progress=True).files

    tell("2  Calibrate: guaranteed linear programmes for bench, accelerometers and gyros together")
    bench = read_record(files[0], PositionRecord)
    calibration = calibrate_whole(bench, bench_place(scenario), noise_bound=NOISE_BOUND)
    write_text(out / "calibration.json", calibration.json_text())
    truth = true_targets(scenario)
    inside = inside_intervals(calibration, truth)
    print(calibration)
    print(f"{inside} of {len(truth)} true values lie inside their intervals")

    tell("3  Measure: a record of encoders, gyros and accelerometers with one hidden effect comes in")
    measured = out / "measured.csv"
    answer_file = out / "hidden-answer.json"
    case = short_bench(seed)
    write_hidden_record(case, measured, answer_file, progress=True)

    tell("4  Diagnose: falsify the simulation, name the cause, extend the FMU, simulate again")
    diagnosis = diagnose(read_record(measured, PositionRecord), **case.instrument.asked, progress=True)
    write_text(out / "diagnosis.json", diagnosis.json_text())
    extended = export_extended(diagnosis, out / "extended")
    print(diagnosis)
    hidden = effect_words(case.answer()["hidden"])
    is_named = judged_case(case, diagnosis).outcome == "right"
    naming = "named" if is_named else "not named"
    print(f"what was hidden: {hidden} -> {naming.replace('not', 'NOT')}")

    tell("5  Beyond the catalogue: an encoder errs in one part of its circle, as no effect of the catalogue does")
    bumped = with_bump(draw_alone(seed, effects=[]).measured())
    outside = diagnose(bumped, noise_bound=NOISE_BOUND, rerun=False)
    write_text(out / "outside.json", outside.json_text())
    print(outside)

    tell("6  Attitude: a real record through the attitude computer")
    attitude = attitude_of_measured_record(out)

    verdict = (
        f"{inside} of {len(truth)} true values lie inside their guaranteed intervals; the effect hidden in the second "
        f"record was {naming}."
    )
    sections = [
        run_section(pl.read_parquet(files[0]), calibration.gravity, list(files)),
        *target_sections(calibration, truth, [out / "calibration.json"]),
        *gyro_sections(calibration),
        Section(
            "A measured record with a hidden effect",
            "A second bench, with encoders, gyros and accelerometers, was simulated with one more piece of physics in "
            f"it. The diagnosis saw the record alone. What had been hidden: {hidden}.",
            files=[measured, answer_file],
        ),
        *answer_of(diagnosis, [out / "diagnosis.json", *extended]),
        *sections_of(diagnosis),
        Section(
            "A record whose cause is in no catalogue",
            "A third bench, simulated, whose outer encoder errs by up to 41 arcsec about 115°, over some 70°: no "
            "effect of the catalogue does so, and none is named.",
            files=[out / "outside.json"],
        ),
        *band_sections(outside),
        attitude,
    ]
    page = out / "index.html"
    hashes = json.loads(files[1].read_text(encoding="utf-8"))["fmus"]
    provenance = {name: version(name) for name in ("trihedron", "fmpy", "pythonfmu", "highspy", "numpy", "scipy")}
    provenance |= {f"{name} FMU, sha256": entry["sha256"] for name, entry in hashes.items()}
    provenance |= {"seed of the hidden effect": str(seed)}
    tone = "good" if is_named and inside == len(truth) else "attention"
    write_text(
        page,
        html(Page("Trihedron: the bench, end to end", verdict, sections, tone=tone, provenance=provenance), folder=out),
    )
    print(f"\nwritten: {', '.join(str(path) for path in [*files, measured, *extended])}")
    print(f"page: {page.resolve()}")
    if show:
        open_page(page)
    return page


def short_bench(seed: int) -> Case:
    """A bench with encoders, gyros and accelerometers that hides one effect; the seed decides everything."""
    rng = np.random.default_rng(seed)
    drawn = draw_whole(rng)
    bench = replace(drawn, alpha=drawn.alpha[-POSITIONS:], beta=drawn.beta[-POSITIONS:], step_s=STEP_S)
    return Case(seed, None, bench, (HIDDEN[rng.integers(len(HIDDEN))],))


def with_bump(record: PositionRecord) -> PositionRecord:
    """The record as an outer encoder would have written it that errs in one part of its circle."""
    apart = np.remainder(record.alpha - BUMP_AT + np.pi, 2.0 * np.pi) - np.pi
    return replace(record, alpha=record.alpha + BUMP_HEIGHT * np.exp(-((apart / BUMP_WIDTH) ** 2)))


def tell(line: str) -> None:
    """A heading between the steps."""
    print(f"\n{line}\n{'-' * len(line)}", flush=True)


def copied_scenario(out: Path) -> Path:
    """The scenario and the files that it names, where the user can read and change them."""
    folder = out / "scenario"
    make_folders(folder)
    source = resources.files("trihedron.scenarios")
    text = (source / IMU_CALIBRATION).read_text(encoding="utf-8")
    for phrase, shorter in SHORTER.items():
        text = text.replace(phrase, shorter)
    write_text(folder / IMU_CALIBRATION, text)
    with resources.as_file(source / "imu-calibration-positions.csv") as path:
        shutil.copyfile(path, folder / path.name)
    return folder / IMU_CALIBRATION


def true_values(scenario: Scenario, component: str) -> dict[str, Any]:
    """The parameters of a scenario's component, those that it does not name too; none where it is not in it."""
    for fmu in scenario.fmus.values():
        if fmu.component == component:
            return components()[component].parameter_starts | fmu.parameters
    return {}


def bench_place(scenario: Scenario) -> Bench:
    """Return the place of a scenario's table on Earth, and the bound of its encoders' error."""
    table = true_values(scenario, "TurntableMotion")
    latitude, azimuth = (math.degrees(table[name]) for name in ("latitude", "azimuth"))
    return Bench(latitude, azimuth, encoder_bound=table["encoder_fluctuation_bound"])


def true_targets(scenario: Scenario) -> dict[str, float]:
    """True values of the 18 targets of a scenario's bench (the mounting is the identity), and of its gyros'."""
    truth = {name: true_values(scenario, name) for name in ("TurntableMotion", "AccelerometerBlock")}
    targets = dict(zip(TARGETS, target_values(true_elementary(truth, ()), np.eye(3)).tolist(), strict=True))
    if gyros := true_values(scenario, "GyroBlock"):
        # This block lacks the other gyro parameters that the calibration seeks.
        of_gyros = dict.fromkeys((*GYRO_PARAMETERS, *LATENCIES), 0.0)
        of_gyros |= zip(GYRO_PARAMETERS[BIAS], gyros["bias"], strict=True)
        of_gyros |= zip(GYRO_PARAMETERS[MATRIX], gyros["scale_misalignment"], strict=True)
        targets |= of_gyros
    return targets


def inside_intervals(calibration: Calibration, truth: dict[str, float]) -> int:
    """Return the number of true values inside their exact intervals."""
    every = calibration.parameters
    return sum(e.low is not None and e.high is not None and e.low <= truth[e.symbol] <= e.high for e in every)


def effect_words(hidden: dict[str, Any]) -> str:
    """Describe the hidden effect in words."""
    if hidden["effect"] is None:
        return "nothing"
    order = f" order {hidden['order']}" if "order" in hidden else ""
    sizes = ", ".join(f"{name} {digits(value, 4)}" for name, value in hidden["parameters"].items())
    return f"{hidden['effect']} {hidden['where']}{order} ({sizes})"


def attitude_of_measured_record(out: Path) -> Section:
    """The section on the real record, or where to get it."""
    path = find_record(MEASURED_RECORD)
    if path is None:
        print(WHERE_TO_GET)
        return Section("A measured strapdown record", [WHERE_TO_GET])
    record = read_record(path, StrapdownRecord)
    last = run = run_attitude(record, out=out / "attitude-run", progress=True)
    lines = [run_line(run), *error_lines(run)]
    bias = rate_at_rest(record)
    if bias is not None:
        last = run_attitude(record, gyro_bias=bias, progress=True)
        lines += error_lines(last)
    print("\n".join(lines))
    return Section(
        "A measured strapdown record",
        [sentence(line) for line in lines],
        attitude_picture(last),
        "The computed attitude less the true one; the gyros' bias at rest is taken out where it is known.",
        files=run.files,
    )


def open_page(page: Path) -> None:
    """Open the page in a browser where a person is watching."""
    screen = sys.platform in ("darwin", "win32") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if screen and sys.stdout.isatty():
        webbrowser.open(page.resolve().as_uri())


def find_record(name: str) -> Path | None:
    """A measured record by its file's name, as "broad-03.strapdown.csv", None where it is not there.

    It is looked for in the folder that $TRIHEDRON_DATA names, then in `../shared/data` beside the checkout.
    """
    folders = [Path(__file__).resolve().parents[2] / "shared" / "data"]
    if os.environ.get(VARIABLE):
        folders.insert(0, Path(os.environ[VARIABLE]))
    for folder in folders:
        path = folder / Path(name).name
        if path.is_file():
            return path
    return None
