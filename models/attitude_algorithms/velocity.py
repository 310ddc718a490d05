"""The strapdown velocity computer: velocity increments with rotation and sculling compensation, beside the attitude.

The velocity of a step is u = ∫ C f dt, C from the body to its attitude at the beginning of the step, f the specific
force. With ε² = 0 attitude and velocity are one equation: the dual rate ω + ε f turns the dual attitude λ̂ as ω turns
λ. So each rotation vector φ = Σ γ_i + Σ k_ij γ_i × γ_j has a velocity of the same k_ij and the same orders,

    σ = Σ υ_i + Σ k_ij (γ_i × υ_j + υ_i × γ_j),   u = σ + (1 - cos φ)/φ² φ × σ + (φ - sin φ)/φ³ φ × (φ × σ),

υ_i = ∫ f dt over a sample: the products are sculling, the other terms are rotation, exact for constant ω and f. That is
the form "joint". The classic one puts sums of increments into the rotation, α = Σ γ_i and υ = Σ υ_i in place of φ and
σ. It adds the products of σ afterwards: of third order at most. Its first order has ½ α × υ for the rotation: of second
order. If the attitude is iterated, f is the polynomial through the increments like ω, and C f is integrated over the
nodes, after the last iteration.

Source: P. Savage, "Strapdown inertial navigation integration algorithm design", part 2, JGCD 21(2), 1998, for the
classic form; K. Roscoe, "Equivalency between strapdown inertial navigation coning and sculling integrals/algorithms",
JGCD 24(2), 2001, for the duality, which the dual attitude makes exact. Both from memory: tests hold orders and drifts.
"""

import math

from ..restricted import Vector
from ..rotation import (
    add_cross,
    add_increment,
    clear,
    complete_rotation_vector,
    multiply,
    set_quaternion,
    square_of_vector,
    sum_of_increments,
    to_reference,
)
from .adaptive import OTHER, OWN, WINDOW, add_products, is_smooth, pair_of_increments, place_window
from .computer import (
    KNOWN,
    LEFT,
    PERIOD,
    READS_PREVIOUS,
    SAMPLES,
    STEP_SIZE,
    TAKEN,
    WAITING,
    begin_attitude,
    collect,
    turn_attitude,
)
from .iteration import (
    EXTRA_NODES,
    VALUES,
    functional_iteration,
    increments_iterated,
)
from .products import rotation_vector, weighted_before

FORMS = ("joint", "classic", "first-order")
"""Kinds of rotation compensation, from 1 on."""

JOINT = 1.0
FIRST_ORDER = 3.0

LARGEST_INCREMENT = 1e6
"""Largest accepted velocity increment [m/s]."""


def velocity_by_products(
    form: float,
    previous: Vector,
    g: Vector,
    previous_v: Vector,
    v: Vector,
    products: Vector,
    weighted: Vector,
    phi: Vector,
    sigma: Vector,
    gained: Vector,
) -> None:
    """Add the velocity of a step to `gained` (3,).

    Parameters
    ----------
    form : float
        one of `FORMS`
    previous, g, previous_v, v : (STEP_SIZE,)
        increments of angle [rad] and velocity [m/s], of the previous step and of this one
    products
        from `prepare_products`; without products the step has one sample
    weighted, phi, sigma : (4,)
        working space
    """
    samples = 1
    if products[0] > 0.0:
        samples = int(products[0])
    sum_of_increments(g, samples, phi)
    sum_of_increments(v, samples, sigma)
    if form != JOINT:
        add_rotation(form, phi, sigma, gained)
        for k in range(4):
            sigma[k] = 0.0
    at = 1
    while products[0] > 0.0 and products[at] > 0.0:
        j = int(products[at]) - 1
        weighted_before(products, at, previous, g, weighted)
        add_cross(1.0, weighted, 0, v, j, sigma)
        at = weighted_before(products, at, previous_v, v, weighted)
        add_cross(1.0, weighted, 0, g, j, sigma)
    if form == JOINT:
        if products[0] > 0.0:
            rotation_vector(previous, g, products, weighted, phi)
        add_rotation(form, phi, sigma, gained)
    else:
        for k in range(3):
            gained[k] = gained[k] + sigma[1 + k]


def add_rotation(form: float, phi: Vector, sigma: Vector, gained: Vector) -> None:
    """Add σ + a φ × σ + b φ × (φ × σ) to `gained` (3,); vectors in phi[1..3], sigma[1..3]."""
    square = square_of_vector(phi)
    a = 0.5 - square / 24.0
    b = 1.0 / 6.0 - square / 120.0
    if form == FIRST_ORDER:
        a = 0.5
        b = 0.0
    elif square > 1e-8:
        angle = math.sqrt(square)
        sine = math.sin(0.5 * angle)
        a = 2.0 * sine * sine / square
        b = (angle - math.sin(angle)) / (square * angle)
    x = phi[2] * sigma[3] - phi[3] * sigma[2]
    y = phi[3] * sigma[1] - phi[1] * sigma[3]
    z = phi[1] * sigma[2] - phi[2] * sigma[1]
    gained[0] = gained[0] + sigma[1] + a * x + b * (phi[2] * z - phi[3] * y)
    gained[1] = gained[1] + sigma[2] + a * y + b * (phi[3] * x - phi[1] * z)
    gained[2] = gained[2] + sigma[3] + a * z + b * (phi[1] * y - phi[2] * x)


def velocity_by_iteration(
    count: int,
    g: Vector,
    v: Vector,
    first: int,
    table: Vector,
    start: Vector,
    space: Vector,
    node: Vector,
    turned: Vector,
    gained: Vector,
) -> int:
    """Add the velocity of `count` increments to `gained` (3,), which begin at the attitude `start` within the step.

    Parameters
    ----------
    g, v : (3 * (first + count),) or longer
        increments of angle [rad] and velocity [m/s]; those from number `first` on are taken
    table, space, turned
        as of `functional_iteration`
    node : (4,)
        working space

    Returns
    -------
    int
        0, or 1 if the iteration does not end
    """
    if functional_iteration(count, g, first, table, space, turned) == 1:
        return 1
    nodes = count + EXTRA_NODES
    total_x = 0.0
    total_y = 0.0
    total_z = 0.0
    for i in range(nodes):
        weight = table[nodes * (count + nodes) + i]
        x = 0.0
        y = 0.0
        z = 0.0
        for n in range(count):
            part = weight * table[count * i + n]
            x = x + part * v[3 * (first + n)]
            y = y + part * v[3 * (first + n) + 1]
            z = z + part * v[3 * (first + n) + 2]
        at = VALUES + 4 * i
        set_quaternion(1.0 + space[at], space[at + 1], space[at + 2], space[at + 3], node)
        to_reference(node, x, y, z, space)
        total_x = total_x + space[0]
        total_y = total_y + space[1]
        total_z = total_z + space[2]
    add_turned(start, total_x, total_y, total_z, space, gained)
    return 0


def add_turned(q: Vector, x: float, y: float, z: float, space: Vector, gained: Vector) -> None:
    """Add q v q* of a vector (x, y, z) to `gained` (3,); `space` (3,) is working space."""
    to_reference(q, x, y, z, space)
    for k in range(3):
        gained[k] = gained[k] + space[k]


def velocity_of_window(
    previous: Vector,
    known: float,
    g: Vector,
    previous_v: Vector,
    v: Vector,
    table: Vector,
    space: Vector,
    node: Vector,
    part: Vector,
    turned: Vector,
    gained: Vector,
) -> None:
    """Add the velocity of a window of eight increments, by iteration if the increments of angle and velocity support
    it.

    `turned` (4,) is the quaternion of the window so far; others as of `velocity_by_iteration`.
    """
    place_window(previous, g, OWN, space)
    place_window(previous_v, v, OTHER, space)
    smooth = is_smooth(known, OWN, math.pi, space)
    of_velocity = is_smooth(known, OTHER, 1e300, space)
    set_quaternion(1.0, 0.0, 0.0, 0.0, turned)
    if smooth + of_velocity == 2 and velocity_by_iteration(8, g, v, 0, table, turned, space, node, part, gained) == 0:
        return
    place_window(previous, g, OWN, space)
    place_window(previous_v, v, OTHER, space)
    if known == 1.0:
        for n in range(WINDOW, 2 * WINDOW):
            clear(part)
            clear(node)
            add_increment(1.0, space, OWN + n, part)
            add_increment(1.0, space, OTHER + n, node)
            add_products(OWN + n, OWN + n, space, part)
            add_products(OWN + n, OTHER + n, space, node)
            add_products(OTHER + n, OWN + n, space, node)
            for k in range(3):
                space[k] = 0.0
            add_rotation(JOINT, part, node, space)
            add_turned(turned, space[0], space[1], space[2], space, gained)
            complete_rotation_vector(part)
            multiply(turned, part, turned)
    else:
        for pair in range(4):
            velocity_of_pair(g, v, 2 * pair, node, part, space)
            add_turned(turned, space[0], space[1], space[2], space, gained)
            pair_of_increments(g, 2 * pair, part)
            multiply(turned, part, turned)


def velocity_of_pair(g: Vector, v: Vector, first: int, phi: Vector, sigma: Vector, gained: Vector) -> None:
    """Write the velocity (3,) of two increments into `gained`, with k = 2/3; `phi`, `sigma` (4,) are working space."""
    clear(phi)
    clear(sigma)
    for i in range(2):
        add_increment(1.0, g, first + i, phi)
        add_increment(1.0, v, first + i, sigma)
    add_cross(2.0 / 3.0, g, first, g, first + 1, phi)
    add_cross(2.0 / 3.0, g, first, v, first + 1, sigma)
    add_cross(2.0 / 3.0, v, first, g, first + 1, sigma)
    for k in range(3):
        gained[k] = 0.0
    add_rotation(JOINT, phi, sigma, gained)


def velocity_of_step(
    algorithm: float,
    form: float,
    known: float,
    previous: Vector,
    collected: Vector,
    previous_v: Vector,
    collected_v: Vector,
    table: Vector,
    space: Vector,
    node: Vector,
    part: Vector,
    turned: Vector,
    gained: Vector,
) -> int:
    """Write the velocity (3,) of a full step, in the body axes at its beginning, into `gained` [m/s].

    Arguments are those of `computer.update`, and increments of velocity as those of angle. Returns 0, or 1 if a
    functional iteration does not end.
    """
    for k in range(3):
        gained[k] = 0.0
    count = increments_iterated(algorithm)
    if algorithm == 27.0:
        velocity_of_window(
            previous, known, collected, previous_v, collected_v, table, space, node, part, turned, gained
        )
    elif count > 0:
        set_quaternion(1.0, 0.0, 0.0, 0.0, part)
        return velocity_by_iteration(count, collected, collected_v, 0, table, part, space, node, turned, gained)
    else:
        velocity_by_products(form, previous, collected, previous_v, collected_v, table, node, part, turned, gained)
    return 0


def initialise_velocity(
    time: float,
    algorithm: float,
    sample_period: float,
    initial_attitude: Vector,
    initial_velocity: Vector,
    attitude: Vector,
    velocity: Vector,
    gained: Vector,
    updated: Vector,
    progress: Vector,
    collected: Vector,
    previous: Vector,
    collected_v: Vector,
    previous_v: Vector,
    table: Vector,
    before: Vector,
    sample: Vector,
    sample_v: Vector,
    algorithms: Vector,
    products: Vector,
) -> int:
    """Begin at the initial attitude and velocity; returns 0 or the number of a message."""
    for k in range(3):
        velocity[k] = initial_velocity[k]
        gained[k] = 0.0
        sample_v[k] = 0.0
    for k in range(STEP_SIZE):
        collected_v[k] = 0.0
        previous_v[k] = 0.0
    return begin_attitude(
        time,
        algorithm,
        sample_period,
        initial_attitude,
        attitude,
        updated,
        progress,
        collected,
        previous,
        table,
        before,
        sample,
        algorithms,
        products,
    )


def step_velocity(
    time: float,
    step: float,
    increment: Vector,
    velocity_increment: Vector,
    algorithm: float,
    form: float,
    gravitation: Vector,
    effect: Vector,
    renormalise: float,
    attitude: Vector,
    velocity: Vector,
    gained: Vector,
    updated: Vector,
    progress: Vector,
    collected: Vector,
    previous: Vector,
    collected_v: Vector,
    previous_v: Vector,
    table: Vector,
    space: Vector,
    node: Vector,
    part: Vector,
    turned: Vector,
    before: Vector,
    added: Vector,
    sample: Vector,
    sample_v: Vector,
) -> int:
    """Take the increments over (time, time + step]; update attitude and velocity when a step of the algorithm is full.

    As `step_attitude` with increments; returns 0 or the number of a message.
    """
    for k in range(3):
        # Infinity and NaN fail the comparison.
        if not math.fabs(velocity_increment[k]) <= LARGEST_INCREMENT:
            return 6
    count = progress[TAKEN]
    remaining = progress[LEFT]
    refused = collect(time, step, increment, effect, updated, progress, collected, before, added, sample)
    if refused > 0 or (progress[TAKEN] == count and progress[LEFT] == remaining):
        return refused
    for k in range(3):
        if remaining == progress[PERIOD] or remaining <= 0.0:
            sample_v[k] = 0.0
        sample_v[k] = sample_v[k] + velocity_increment[k]
    if progress[TAKEN] == count:
        return 0
    for k in range(3):
        collected_v[3 * (int(progress[WAITING]) - 1) + k] = sample_v[k]
    if progress[WAITING] < progress[SAMPLES]:
        return 0
    failed = velocity_of_step(
        algorithm,
        form,
        progress[KNOWN],
        previous,
        collected,
        previous_v,
        collected_v,
        table,
        space,
        node,
        part,
        turned,
        gained,
    )
    if failed == 1:
        return 5
    to_reference(attitude, gained[0], gained[1], gained[2], space)
    for k in range(3):
        velocity[k] = velocity[k] + space[k] + gravitation[k] * progress[PERIOD] * progress[SAMPLES]
    if progress[READS_PREVIOUS] == 1.0:
        size = 3 * int(progress[SAMPLES])
        for k in range(size):
            previous_v[k] = collected_v[k]
    return turn_attitude(
        algorithm, renormalise, attitude, updated, progress, collected, previous, table, space, part, turned
    )
