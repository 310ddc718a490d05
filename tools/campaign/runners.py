"""The kinds of runs: which runner makes those of a campaign, and what columns its data set has."""

import polars as pl

from ..errors import InputError, nearest
from .file import Campaign
from .kinds import Columns, Runner


def make_runner(campaign: Campaign) -> Runner:
    """The runner of a campaign; InputError where what the file asks for cannot be done."""
    # Each kind is loaded only where it is run.
    if campaign.calibration is not None:
        from .calibration_runs import CalibrationRuns

        return CalibrationRuns(campaign, campaign.calibration)
    if campaign.attitude is not None:
        from .attitude_runs import AttitudeRuns

        return AttitudeRuns(campaign, campaign.attitude)
    if campaign.simulation is not None:
        from .simulation_runs import SimulationRuns

        return SimulationRuns(campaign, campaign.simulation)
    from .hidden_runs import HiddenRuns

    assert campaign.hidden is not None
    return HiddenRuns(campaign, campaign.hidden)


def columns_of(campaign: Campaign, runner: Runner) -> Columns:
    """The columns of the data set; refuses names that are not there, or that mean two things."""
    parameters: dict[str, type[pl.DataType]] = {}
    for name, axis in campaign.parameters.items():
        sample = axis.listed()[0] if axis.discrete else 0.0
        parameters[name] = (
            pl.Boolean if isinstance(sample, bool) else pl.String if isinstance(sample, str) else pl.Float64
        )
    outputs = dict(runner.outputs)
    for name in parameters:
        if name in outputs or name in Columns({}, {}).own:
            raise InputError(f"parameters.{name}: a run gives a scalar of that name")
    wanted = campaign.keep.scalars
    for name in wanted or ():
        if name not in outputs:
            raise InputError(f"keep.scalars: '{name}' is not what a run gives; {nearest(name, list(outputs))}")
    kept = {name: output for name, output in outputs.items() if wanted is None or name in wanted}
    there = {**{name: output.dtype for name, output in kept.items()}, **parameters}
    for number, computation in enumerate(campaign.compute, start=1):
        for name in computation.names:
            if name not in there:
                raise InputError(
                    f"compute[{number}]: '{name}' is no column of the results; {nearest(name, list(there))}"
                )
        numeric = [*(computation.quantiles or []), *(computation.sensitivity or [])]
        numeric += [] if computation.against is None else [computation.against]
        for name in numeric:
            if there[name] not in (pl.Float64, pl.Int64, pl.Boolean):
                raise InputError(f"compute[{number}]: '{name}' is a text, where a number is wanted")
    if any(c.sensitivity for c in campaign.compute) and not any(t == pl.Float64 for t in parameters.values()):
        raise InputError("compute: sensitivity needs parameters that are numbers")
    return Columns(parameters, kept, campaign.keep.diagnosis, campaign.keep.record)
