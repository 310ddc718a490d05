"""One update by whichever algorithm is chosen: the one entry that the attitude computer, tests and comparisons use."""

from ..restricted import Vector
from .formulas import (
    five_sample_coning,
    four_sample_coning,
    four_sample_rotation_vector,
    mean_rate,
    one_sample_quaternion,
    one_sample_rodrigues,
    one_sample_rodrigues_symmetric,
    panov,
    panov_cut_off,
    panov_series,
    three_sample_coning,
    two_sample_fifth_power,
    two_sample_quaternion,
    two_sample_rodrigues,
    two_sample_rodrigues_second_iterate,
    two_sample_rodrigues_third_order,
    two_sample_rotation_vector,
    two_sample_textbook,
    two_sample_textbook_as_run,
)
from .iteration import (
    EXTRA_NODES,
    FEWEST_INCREMENTS,
    LARGEST_TABLE,
    MOST_INCREMENTS,
    WINDOW,
    adaptive_degree,
    functional_iteration,
    prepare_functional_iteration,
)

STEP_SIZE = 3 * MOST_INCREMENTS
"""Length of the arrays with the increments of a step."""

TABLE_SIZE = LARGEST_TABLE
"""Length of `table`."""

HALF_TABLE_SIZE = (WINDOW + EXTRA_NODES + 1) * (WINDOW // 2 + EXTRA_NODES)
"""Length of `half_table`."""

WORK_SIZE = 4 * (MOST_INCREMENTS + EXTRA_NODES)
"""Length of each of the working arrays `differences`, `rates`, `values`, `slopes`."""


def prepare_update(algorithm: float, table: Vector, half_table: Vector) -> None:
    """Write the tables that an algorithm needs; called once, before the first update.

    Parameters
    ----------
    algorithm : float
        number of the algorithm
    table, half_table : (TABLE_SIZE,), (HALF_TABLE_SIZE,)
    """
    for count in range(FEWEST_INCREMENTS, MOST_INCREMENTS + 1):
        if algorithm == 18.0 + count:
            prepare_functional_iteration(count, table)
    if algorithm == 27.0:
        prepare_functional_iteration(8, table)
        prepare_functional_iteration(4, half_table)


def update(
    algorithm: float,
    previous: Vector,
    known: float,
    g: Vector,
    table: Vector,
    half_table: Vector,
    differences: Vector,
    rates: Vector,
    values: Vector,
    slopes: Vector,
    part: Vector,
    turned: Vector,
) -> int:
    """Write the quaternion λ* of a step.

    Parameters
    ----------
    algorithm : float
        number of the algorithm
    previous, g : (STEP_SIZE,)
        increments of the step before and of this one, sample after sample [rad]
    known : float
        1.0 where there is a step before; where not, `previous` is zero
    table, half_table : from `prepare_update`
    differences, rates, values, slopes : (WORK_SIZE,)
        working space
    part : (4,)
        working space
    turned : (4,)
        the quaternion; on the unit sphere but for what the algorithm cuts off

    Returns
    -------
    int
        0, or 1 where a functional iteration does not end
    """
    if algorithm == 1.0:
        two_sample_rodrigues(g, turned)
    elif algorithm == 2.0:
        mean_rate(g, turned)
    elif algorithm == 3.0:
        one_sample_quaternion(previous, g, turned)
    elif algorithm == 4.0:
        one_sample_rodrigues(previous, g, turned)
    elif algorithm == 5.0:
        one_sample_rodrigues_symmetric(previous, g, turned)
    elif algorithm == 6.0:
        two_sample_rodrigues_second_iterate(g, turned)
    elif algorithm == 7.0:
        two_sample_rodrigues_third_order(g, turned)
    elif algorithm == 8.0:
        two_sample_quaternion(g, turned)
    elif algorithm == 9.0:
        two_sample_textbook(g, turned)
    elif algorithm == 10.0:
        two_sample_textbook_as_run(g, turned)
    elif algorithm == 11.0:
        two_sample_rotation_vector(g, turned)
    elif algorithm == 12.0:
        two_sample_fifth_power(g, turned)
    elif algorithm == 13.0:
        panov(g, turned)
    elif algorithm == 14.0:
        panov_series(g, turned)
    elif algorithm == 15.0:
        panov_cut_off(g, turned)
    elif algorithm == 16.0:
        four_sample_rotation_vector(g, turned)
    elif algorithm == 17.0:
        three_sample_coning(g, turned)
    elif algorithm == 18.0:
        four_sample_coning(g, turned)
    elif algorithm == 19.0:
        five_sample_coning(g, turned)
    elif algorithm == 27.0:
        adaptive_degree(previous, known, g, table, half_table, differences, rates, values, slopes, part, turned)
    else:
        for count in range(FEWEST_INCREMENTS, MOST_INCREMENTS + 1):
            if algorithm == 18.0 + count:
                return functional_iteration(count, g, 0, table, rates, values, slopes, turned)
    return 0
