"""A slip of the block on the table, as readings and turns of a bench record show it: gyros see the slip itself.

Behind it the block stands otherwise, for accelerometers and gyros alike; the turn over the gap holds the slip, which no
encoder sees. It is linear at half a slip: what a whole one does is missed by the third order of its size.
"""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...models.bench import small_turn
from ...models.bench_turns import GYRO_PARAMETERS, LAG, MATRIX, integrated_readings, moments_of
from ...models.effects.steps import MOUNTING_SLIP
from ..calibration.model import slip_jacobian
from ..calibration.turns import WithTurns
from ..records import BenchRecord
from ..records.rests import without_turns
from .bench_moving import Moving
from .fit import Fit
from .observation import Group
from .onsets import Acting, Columns, Fading, Onsets
from .rows import Pieces

(SLIP,) = MOUNTING_SLIP.places
FINEST, MOST_FINER = 0.02, 16
"""Times of a slip are so near that what it turns between two counts so much of a bound; so many a row at most."""


@dataclass(frozen=True, eq=False)
class SlipOnsets(Onsets):
    """Columns of a slip after each moment of a record: of readings, then of what gyros integrate.

    `hours` are of one or several moments a row, since the record's first rest; `whole` (S, 3, 3) of each part what the
    slip adds where it is within a piece, or before a reading: nothing is told of a reading that is of both sides of it.
    `missed`: what so few moments miss, in bounds.
    """

    whole: tuple[NDArray[np.float64], ...]
    missed: float

    at_once: ClassVar[int] = 1

    @staticmethod
    def of(raw: BenchRecord, both: WithTurns, moving: Moving, about: Fit | None) -> "SlipOnsets":
        """Linear at half the slip of a fit, and its parameters; by default at none, and the nominal model's."""
        turns, own, count = both.turns, both.own, len(both.point)
        point = np.append(both.point, 0.0) if about is None else about.point
        half = np.zeros(3) if about is None else 0.5 * about.coefficients[about.blocks[about.places.index(SLIP)]]
        turned = block_turns(raw, both, point[:count])
        step = np.linalg.norm(np.diff(turned, axis=0), axis=1).max() * 2.0 * np.linalg.norm(half)
        step /= float(both.bound[-3 * len(turns.first) :].min())
        finer = int(np.clip(np.ceil(step / FINEST), 1, MOST_FINER))
        time = np.interp(np.arange((len(turned) - 1) * finer + 1) / finer, np.arange(len(turned)), raw.time_s)
        late = time - point[own + LAG]
        fine = np.stack([np.interp(late, raw.time_s, turned[:, k]) for k in range(3)], axis=1)
        # Complex steps: derivatives of the frame by the slip.
        slopes = np.imag([small_turn(half + 1e-30j * axis) for axis in np.eye(3)]) / 1e-30
        readings = moving.lagging(float(point[-1]))[0]
        at = replace(readings.at, slips=np.tile(half, (len(readings), 1)))
        seen = slip_jacobian(readings.parametrisation, point[:own], at, readings.sign)
        gain = np.eye(3) + point[own:count][MATRIX].reshape(3, 3)
        pieces = (
            Pieces("rests", "readings", *(finer * moving.seen.span.T)),
            Pieces("turns", "turns", finer * turns.first, finer * turns.last),
        )
        # A gyro that is read now and then does not tell how far it turned at once.
        across = np.full((len(turns.first), 3, 3), np.nan) if raw.increment is None else [gain] * len(turns.first)
        turning = np.broadcast_to(np.eye(3), (len(turns.first), 3, 3))
        grown = np.einsum("gi,kij,nj->ngk", gain, slopes, fine)
        return SlipOnsets(
            (time - moving.read.readings.circumstances.began) / 3600.0,
            (Group(pieces[0], np.zeros_like(seen)), Group(pieces[1], turning)),
            np.zeros(len(time), dtype=bool),
            # Gyros of a block that stands otherwise have turned more; no mean at rest is taken out.
            lambda place: (grown, np.zeros_like(grown)),
            (seen, np.asarray(across)),
            step / finer,
        )

    def columns(self, acting: Acting | Fading, row: float) -> tuple[Columns, NDArray[np.float64]]:
        """As of other effects, with the slip itself; NaN of readings that are of both sides of it."""
        found, mean = super().columns(acting, row)
        read, turned = (group.pieces for group in self.groups)
        before, across = read.last <= row, (turned.first <= row) & (row < turned.last)
        found[0] = self.whole[0] * ~before[:, None, None]
        found[0][~before & (read.first <= row)] = np.nan
        found[1][across] += self.whole[1][across]
        return found, mean

    def within(self, acting: Acting, begin: int, end: int) -> Columns:
        """As of other effects, where the slip is behind the moment `end` at the latest and a moment follows it."""
        columns = self.columns(acting, end)[0]
        for k, group in enumerate(self.groups):
            holding = (group.pieces.first <= begin) & (group.pieces.last > end) & (k > 0)
            turn = group.gain * holding[:, None, None]
            turn[~(holding | (group.pieces.last <= begin) | (group.pieces.first > end))] = np.nan
            columns[k] = np.concatenate([columns[k], turn], axis=2)
        return columns


def block_turns(raw: BenchRecord, both: WithTurns, point: NDArray) -> NDArray[np.float64]:
    """How far (N, 3) [rad] the block has turned up to each row, in its axes, by parameters of bench and gyros."""
    moments = moments_of(raw.time_s, without_turns(raw.alpha), without_turns(raw.beta))
    targets, none = both.parametrisation.selection[0] @ point[: both.own], np.zeros(len(GYRO_PARAMETERS))
    still = np.zeros((2, *moments.shape))
    return integrated_readings(targets, none, moments, still, both.turns.mounting, both.turns.earth)
