"""What was found of a record as FMUs: they start with it, with values and intervals beside, and runs that show it."""

from pathlib import Path

from ..errors import InputError
from ..files import whole_folder
from .cause import Finding
from .result import Diagnosis


def export_extended(result: Diagnosis, folder: Path, flavour: str = "python") -> list[Path]:
    """Write what explains a record, or extends its model, into a folder; the files, none where nothing does.

    FMUs of a flavour, "python" or "native", that start with the parameters and sizes that are stated; beside each a
    parameter set (.ssv) with these and their intervals; and scenarios that run them as the record was measured. An
    outlier is of no FMU. Of hypotheses it is the first that stands.

    An InputError where a value is beyond what a component takes, or the folder cannot be written.
    """
    standing = next((one.finding for one in result.hypotheses or () if one.answer == "stands"), None)
    if standing is None and result.extension is not None:
        standing = Finding(result.extension.causes, result.extension.fit)
    if standing is None and result.verdict != "explained":
        return []
    finding = result.findings[0] if standing is None else standing
    effects = {cause.place: (cause.values, cause.intervals) for cause in finding.causes}
    said = "found of a record: " + " and ".join(place.title for place in effects)
    try:
        evidence = result.evidence.including(finding.fit.places)
        with whole_folder(folder) as beside:
            written = evidence.extension(finding.fit, effects).write(beside, said, flavour)
        return [folder / path.name for path in written]
    except ValueError as error:
        raise InputError(f"--export {folder}: {error}") from error
