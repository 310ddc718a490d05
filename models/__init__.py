"""The physics: pure functions and kernels in restricted Python. It knows no FMI, no files, no options.

Notation used throughout
------------------------
Names are the field's terms; a docstring gives the paper's symbol. Everything inside is SI and radians; degrees
stand only in names that say so (``alpha_deg``). Frames:

base
    axis 1 along the horizontal projection of the table's outer axis, axis 3 up, right-handed.
inner
    fixed to the table's inner frame, axis 3 along the inner axis.
block
    the instrument frame of the accelerometer block: inner frame turned by the mounting Q and the mounting error θ.

A matrix ``r_ab`` takes components in frame b to components in frame a. A quaternion is scalar first and takes body
components to the reference. ``alpha`` is the angle of the outer axis, ``beta`` of the inner axis. Specific force
points up at rest: a level block reads (0, 0, +g).
"""
