"""The restricted Python in which kernels are written.

A kernel runs unchanged as plain Python, is compiled by numba, is carried by a PythonFMU FMU and can be translated to C.
So it uses only

* float scalars, integer indices and flat arrays of floats (`Vector`: a list in plain Python, an array elsewhere);
* ``+ - * /``, comparisons, ``if``, ``for ... in range``, ``while``;
* ``math.sqrt``, ``math.exp``, ``math.log``, ``math.sin``, ``math.cos``, ``math.atan2``, ``math.floor``, ``math.fabs``,
  ``math.pi``;
* calls to other kernels and module constants in capitals;

and no ``**``, ``%``, ``//``, ``round``, objects, slices or keyword arguments. Changed arguments are arrays, even of one
element; read-only ones may be scalars. Working arrays are arguments too: a kernel allocates nothing.

Context
-------
Effects read the circumstances of a reading from one fixed vector; these constants are its places.
"""

from collections.abc import MutableSequence

Vector = MutableSequence[float]

HOURS = 0
"""time since the start [h]"""
TEMPERATURE = 1
"""temperature [degC]"""
ALPHA = 2
"""true angle of the outer axis [rad]; for the block, if its input `angle` is connected"""
BETA = 3
"""true angle of the inner axis [rad]"""
SENSE_ALPHA = 4
"""sense of the last move of the outer axis (+1, -1, 0: none yet)"""
SENSE_BETA = 5
"""sense of the last move of the inner axis"""
SENSE_INPUT = 6
"""senses of the last change of each accelerometer's input (three places)"""
INPUT = 9
"""inputs of the accelerometers [g] (three places)"""
RATE = 12
"""angular rate [rad/s] at the end of the last step (three places), for the accelerometer block, like the following. In
the table's context these are two places, the rates of its axes"""
ANGULAR_ACCELERATION = 15
"""angular acceleration [rad/s²] at the end of the last step (three places)"""
GRAVITY = 18
"""model value of gravity [m/s²]"""
KEPT = 19
"""memory of effects for each accelerometer (three places)"""
BLOCK_RESPONSE = 22
"""I + Γ, the accelerometers' response to the specific force, row by row (nine places)"""
CONTEXT_SIZE = 31
"""length of the context"""

STEP_LENGTH = 12
"""length of the last step [s], 1 before the first; only in the gyro block's context, like the following"""
PREVIOUS_RATE = 13
"""mean rates [rad/s] over the steps before the last one, the newest first, three places each"""
PREVIOUS_STEPS = 8
"""steps before the last one whose rates are kept"""
INTERVAL = 37
"""length of the last step [s] by the record's time stamps, which may jitter while the sampling does not"""
RESPONSE = 38
"""I + Γ, the gyros' response to the rates, row by row (nine places)"""
GYRO_CONTEXT_SIZE = 47
"""length of the gyro block's context"""
