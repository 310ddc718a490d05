"""Sentences on a measurement at the table, during it and after its end, for every view."""

from ..document.blocks import Page, Section
from ..document.notation import listed
from ..measure import Measured, Present, RestVisit, Session, TableSetting
from ..rounding import digits, exactly, residual, upwards


def angles_text(alpha_deg: float, beta_deg: float) -> str:
    """Return two angles of the table."""
    return f"α {exactly(round(alpha_deg, 4))}°, β {exactly(round(beta_deg, 4))}°"


def setting_text(session: Session, setting: TableSetting) -> str:
    """Return a position of the plan with its number in the order of measurement, and the total."""
    number = [planned.number for planned in session.programme.settings].index(setting.number) + 1
    return f"position {number} of {len(session.programme.settings)}: {angles_text(setting.alpha_deg, setting.beta_deg)}"


def next_text(session: Session) -> str:
    """Return the next position of the table."""
    remaining = session.left
    if not remaining:
        return "all positions are measured"
    state = session.state_of(remaining[0])
    return ("repeat " if state == "repeat" else "next ") + setting_text(session, remaining[0])


def promise_text(session: Session) -> str:
    """Return the distance to the promise, or that it is reached and the operator can stop."""
    standing, worst = session.standing, session.worst
    if standing.trouble:
        return standing.trouble
    if worst is None:
        missing = [name for name in session.programme.promised if standing.errors.get(name) is None]
        if len(missing) == len(session.programme.promised):
            return "no target is determined yet"
        return (
            f"{len(missing)} of {len(session.programme.promised)} targets are not determined yet: {', '.join(missing)}"
        )
    if not session.reached:
        name = max(session.programme.promised, key=lambda target: session.share(target) or 0.0)
        return f"the guaranteed errors are up to {upwards(worst, 3)} times what is promised ({name})"
    if standing.against:
        record = session.path.with_suffix(".positions.csv")
        return (
            "the promised errors are reached, but the readings contradict the model: measure on; "
            f"trihedron diagnose {record} --noise-bound {exactly(session.asked.noise_bound)} looks for the cause"
        )
    return "the promise is reached: every guaranteed error is as planned; you can stop"


def shares_text(session: Session) -> str:
    """Return the guaranteed errors over the promised ones, target by target."""
    shares = ((name, session.share(name)) for name in session.programme.promised)
    texts = [f"{name} {'open' if share is None else upwards(share, 3)}" for name, share in shares]
    return "error/promise: " + ", ".join(texts)


def against_text(session: Session) -> str:
    """Return the readings that prove the model wrong; empty if there are none."""
    against = session.standing.against
    if not against:
        return ""
    good = session.good
    readings = [f"rest {good[p - 1].number} f{a}" for p, a in against if p <= len(good)]
    radius = residual(session.standing.radius)
    return f"no parameters explain the readings (they leave {radius} σ at least): {listed(readings, 6)}"


def present_text(session: Session, present: Present) -> str:
    """Return the present state of the table, and whether it may go on."""
    if present.state == "waiting":
        return "waiting for readings"
    alpha, beta = session.angles_deg(present.alpha, present.beta)
    where = angles_text(round(alpha, 3), round(beta, 3))
    if present.state == "moving":
        return f"moving, {where}"
    lasted = f"at rest for {digits(present.lasted_s, 3)} s at {where}"
    if present.state == "settling":
        return f"{lasted}: settling{f' ({present.why})' if present.why else ''}"
    scatter = f"settled for {digits(present.kept_s, 3)} s, scatter {upwards(present.scatter, 2)} of the noise bound"
    if present.why:
        return f"{lasted}: not good so far: {present.why}"
    enough = "good: go on" if len(session.left) > 1 else "good: leave it, or end"
    return f"{lasted}: {scatter}; {enough if present.state == 'enough' else 'stay'}"


def visit_text(session: Session, visit: RestVisit) -> str:
    """Return the result of a rest."""
    alpha, beta = session.visit_angles_deg(visit)
    at = angles_text(alpha, beta)
    number = session.setting_of[visit.number - 1]
    setting = next((planned for planned in session.programme.settings if planned.number == number), None)
    of = "of no position of the plan" if setting is None else setting_text(session, setting).partition(":")[0]
    rows = f"rows {visit.first_row} to {visit.last_row}"
    if visit.bad:
        return f"rest {visit.number} ({of}; {at}) is bad: {visit.bad}; leave the position and come back to it [{rows}]"
    remarks = f"; {', '.join(visit.remarks)}" if visit.remarks else ""
    scatter = f"scatter {upwards(visit.scatter, 2)} of the noise bound"
    return (
        f"rest {visit.number} ({of}; {at}) is good: {digits(visit.kept_s, 3)} s averaged, {scatter}{remarks} [{rows}]"
    )


def measured_page(result: Measured) -> Page:
    """Return the result of a session: positions, promise, rests that do not count, verdict, files."""
    lines = []
    if result.left_out:
        lines.append(f"Lines that are no rows of a record, left out: {result.left_out}.")
    for rest in result.rests:
        if not rest.counts:
            lines.append(f"rest {rest.rest} does not count: {rest.why}")
    undetermined, ratios = [], []
    for target in result.targets:
        if target.guaranteed_error is None:
            undetermined.append(target.symbol)
        else:
            ratios.append(target.guaranteed_error / target.promised)
    if undetermined:
        lines.append(f"Not determined yet: {', '.join(undetermined)}.")
    else:
        outcome = "reached" if result.promise_reached else "not reached"
        worst = upwards(max(ratios), 3)
        lines.append(f"promise {outcome}: guaranteed errors up to {worst} times what the plan promises")
    if result.verdict is not None:
        causes = f": {' and '.join(result.causes)}" if result.causes else ""
        lines.append(f"diagnosis of {result.diagnosed} positions: {result.verdict}{causes}")
    elif result.falsified:
        lines.append("the positions contradict the model")
    verdict = f"{result.done} of {result.planned} positions measured, {result.rows} readings"
    warnings = [result.trouble] if result.trouble else []
    files = [file for file in (result.record, result.positions_file) if file is not None]
    return Page("Measurement", verdict, [Section("Result", lines, files=files)], warnings=warnings)
