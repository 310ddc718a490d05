"""The demonstration: a bench is simulated and calibrated, a hidden error is found, the simulation gets better."""

import json
import math
import os
import shutil
import sys
import textwrap
import webbrowser
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from ..fmus import components, version
from ..models.bench import BIAS, GYRO_PARAMETERS, MATRIX, TARGETS, target_values
from ..models.effects import EffectPlace
from .calibrated import LATENCIES
from .calibration import BenchOnEarth, Calibration, calibrate_whole
from .diagnosis import Diagnosis, diagnose, export_extended
from .document.blocks import Page, Section, Table
from .document.notation import sentence, unit_text
from .document.page import html, table_lines
from .files import make_folders, write_text
from .orchestrator.run import Simulation, simulate_table
from .orchestrator.scenario import Scenario, read_scenario
from .records import PositionRecord, read_record
from .reports import write_report
from .reports.bench import physical_words, run_section, sizes_of
from .reports.beyond import law_picture
from .reports.calibration import gyro_sections, target_section
from .reports.diagnosis import cause_section, gain_picture, sentences_of, sets_of
from .reports.pictures import CARD
from .reports.pictures.residuals import truth_in_intervals
from .rounding import digits, exactly, interval, residual, to_bound
from .trials.bench import NOISE_BOUND, true_elementary
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
"""Texts of the scenario, and those of the demonstration's in their place."""
HIDDEN = (
    Hidden(EffectPlace("quadratic", "accelerometer-2"), (2e-3,)),
    Hidden(EffectPlace("encoder-harmonic", "outer-axis", 2), (3e-4, 0.9)),
)
"""Effects; the seed hides one of them."""
SHOWN = ("X1", "X16", "B1")
"""Parameters that the terminal shows."""
MEASURED, ANSWER = "measured.csv", "hidden-answer.json"
WIDTH, INDENT = 80, 15
"""Columns of the terminal, and of the titles of the steps."""


@dataclass(frozen=True)
class Story:
    """The results of the demonstration.

    Attributes
    ----------
    scenario : Scenario
        the simulated bench
    run : Simulation
        its run
    case : Case
        another bench with one hidden effect
    records : (PositionRecord, PositionRecord)
        the records of both benches
    calibration : Calibration
        the calibration of the first bench
    diagnosis : Diagnosis
        the diagnosis of the second bench
    """

    scenario: Scenario
    run: Simulation
    case: Case
    records: tuple[PositionRecord, PositionRecord]
    calibration: Calibration
    diagnosis: Diagnosis

    @cached_property
    def truth(self) -> dict[str, float]:
        """Return the true values of the calibrated parameters."""
        return true_targets(self.scenario)

    @property
    def inside(self) -> str:
        """Return the number of true values inside their intervals, in words."""
        count = inside_intervals(self.calibration, self.truth)
        return f"{count} of {len(self.truth)} true values lie inside their guaranteed intervals."

    @property
    def cause(self) -> str:
        """Return the diagnosed cause in a sentence."""
        sets = sets_of(self.diagnosis)
        return sentence(sentences_of(sets[0], self.diagnosis)) if sets else "No cause is named."

    @property
    def is_named(self) -> bool:
        """Return True if the hidden effect is the diagnosed one."""
        return judged_case(self.case, self.diagnosis).outcome == "right"

    @property
    def gain(self) -> str:
        """Return the change of the errors at positions that were not used, in a sentence."""
        gain = self.diagnosis.gain
        if gain is None:
            return "No gain was measured."
        before, after = digits(1e6 * gain.held_out_rms_before), digits(1e6 * gain.held_out_rms_after)
        return f"At {len(gain.rows)} positions that the fit did not use, the error falls from {before} to {after} µg."

    @property
    def verdict(self) -> str:
        """Return the result in a sentence."""
        gain = self.diagnosis.gain
        if not self.is_named or gain is None:
            return "The hidden error is NOT named."
        times = digits(gain.held_out_rms_before / gain.held_out_rms_after, 2)
        return f"The hidden error is named, and with it the simulation errs {times} times less."

    def true_table(self) -> Table:
        """Return some parameters with their true values and intervals."""
        rows = []
        for parameter in self.calibration.parameters:
            if parameter.symbol in SHOWN:
                _, low, high = interval(parameter.central, parameter.low, parameter.high)
                name, unit = physical_words(parameter.name), unit_text(parameter.unit)
                rows.append([name, to_bound(self.truth[parameter.symbol], parameter.error_bound), low, high, unit])
        return Table(["parameter", "true", "low", "high", "unit"], rows)

    def size_table(self) -> Table:
        """Return the hidden sizes with the intervals that the diagnosis leaves possible."""
        hidden = self.case.answer()["hidden"]["parameters"]
        rows = []
        for finding in sets_of(self.diagnosis)[:1]:
            for cause in finding.causes:
                for name, _, low, high, unit in sizes_of(cause):
                    rows.append([name, exactly(hidden.get(name)), low, high, unit])
        return Table(["size", "hidden", "low", "high", "unit"], rows)

    def cards(self) -> list[Section]:
        """Return three sections with a picture each: calibrated, found, better."""
        bounded = [parameter for parameter in self.calibration.parameters if parameter.bounded]
        low, high = np.transpose([parameter.ends for parameter in bounded])
        truth = np.array([self.truth[parameter.symbol] for parameter in bounded])
        half = 0.5 * (high - low)
        return [
            Section("Calibrated", self.inside, truth_in_intervals((low - truth) / half, (high - truth) / half)),
            Section("Found", self.cause, law_picture(self.diagnosis, CARD)),
            Section("Better", self.gain, gain_picture(self.diagnosis, CARD)),
        ]

    def details(self, out: Path) -> list[Section]:
        """Return the sections below the cards; write the full reports into a folder."""
        reports = []
        for result, record in zip((self.calibration, self.diagnosis), self.records, strict=True):
            name = type(result).__name__.lower()
            write_text(out / f"{name}.json", result.json_text())
            write_report(out / f"{name}.html", result, record)
            reports += [out / f"{name}.html", out / f"{name}.json"]
        sections = [
            run_section(pl.read_parquet(self.run.files[0]), self.calibration.gravity, list(self.run.files)),
            target_section(self.calibration, self.truth),
            *gyro_sections(self.calibration, self.truth),
            cause_section(self.diagnosis, sorted((out / "extended").iterdir())),
            Section("Records and full reports", files=[out / MEASURED, out / ANSWER, *reports]),
        ]
        return [section for section in sections if section is not None]

    def page(self, out: Path) -> Page:
        """Return the page: three cards, then details."""
        hashes = json.loads(self.run.files[1].read_text(encoding="utf-8"))["fmus"]
        provenance = {name: version(name) for name in ("trihedron", "fmpy", "pythonfmu", "highspy", "numpy", "scipy")}
        provenance |= {f"{name} FMU, sha256": entry["sha256"] for name, entry in hashes.items()}
        provenance |= {"seed of the hidden effect": str(self.case.seed)}
        return Page(
            "Trihedron: simulated, calibrated, found, better",
            self.verdict,
            [],
            lambda: self.details(out),
            tone="good" if self.is_named else "attention",
            provenance=provenance,
            cards=self.cards(),
        )


def run_demo(out: Path, *, seed: int, show: bool) -> Path:
    """Run the demonstration in four steps: the terminal tells each, and a page shows them.

    Parameters
    ----------
    out : Path
        folder for everything that is made
    seed : int
        seed of the record with the hidden effect
    show : bool
        open the page where there is a screen

    Returns
    -------
    Path
        the page
    """
    make_folders(out)
    scenario = read_scenario(copied_scenario(out))
    run = simulate_table(scenario, out / "simulated", progress=True)
    tell(
        "1  Simulated",
        f"A two-axis table carries accelerometers and gyros; an attitude computer follows. {len(scenario.fmus)} FMUs, "
        f"coupled step by step: {run.rests} positions and whole turns.",
    )
    bench = read_record(run.files[0], PositionRecord)
    calibration = calibrate_whole(bench, bench_place(scenario), noise_bound=NOISE_BOUND)
    case = hidden_case(seed)
    write_hidden_record(case, out / MEASURED, out / ANSWER)
    record = read_record(out / MEASURED, PositionRecord)
    diagnosis = diagnose(record, noise_bound=NOISE_BOUND, progress=True)
    export_extended(diagnosis, out / "extended")
    story = Story(scenario, run, case, (bench, record), calibration, diagnosis)
    tell(
        "2  Calibrated",
        f"Linear programmes read the exported record. {story.inside}",
        *table_lines(story.true_table()),
    )
    tell(
        "3  Found",
        f"Another bench is measured: {len(record)} positions, with one hidden error. The calibrated model cannot fit "
        f"them: largest error {residual(diagnosis.radius)} σ.",
        story.cause,
        *table_lines(story.size_table()),
    )
    tell("4  Better", f"The cause goes into the simulation: new FMUs run again. {story.gain}")
    tell("Verdict", story.verdict)
    page = out / "index.html"
    write_text(page, html(story.page(out), folder=out))
    tell("Page", str(page))
    print(f"Next: trihedron diagnose {out / MEASURED} --noise-bound {exactly(NOISE_BOUND)}")
    if show:
        open_page(page)
    return page


def hidden_case(seed: int) -> Case:
    """Return a bench that hides one effect; the seed decides everything."""
    clean = draw_alone(seed, effects=[])
    return replace(clean, hidden=(HIDDEN[seed % len(HIDDEN)],))


def tell(title: str, *texts: str) -> None:
    """Print texts in lines of 80 columns, beside their title."""
    lines = []
    for text in texts:
        indent = (" " if lines else title).ljust(INDENT)
        lines += textwrap.wrap(text, WIDTH, initial_indent=indent, subsequent_indent=" " * INDENT)
    print("\n".join(lines), end="\n\n", flush=True)


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


def bench_place(scenario: Scenario) -> BenchOnEarth:
    """Return the place of a scenario's table on Earth, and the bound of its encoders' error."""
    table = true_values(scenario, "TurntableMotion")
    latitude, azimuth = (math.degrees(table[name]) for name in ("latitude", "azimuth"))
    return BenchOnEarth(latitude, azimuth, encoder_bound=table["encoder_fluctuation_bound"])


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


def open_page(page: Path) -> None:
    """Open the page in a browser where a person is watching."""
    screen = sys.platform in ("darwin", "win32") or os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    if screen and sys.stdout.isatty():
        webbrowser.open(page.resolve().as_uri())
