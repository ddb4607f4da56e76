"""Roll and loading: parameters of a ship's roll from gyro, accelerometer and rudder at several loads.

Frames and signs: b-frame, x to the bow, y to starboard, z down; roll is positive with the starboard side down. Places
of masses and sensors are z [m] from a body origin, so that what lies above it is negative. The accelerometer reads
a_s to port, gravity in it: a_s = z_s phi'' + g phi - v' - U r. The rudder may have any sign and unit. Parameters are
vectors of nine numbers in the order of `PARAMETERS`, with `UNITS`.

    runs -> low_pass, prepared -> estimate_roll -> null_space

Source: doctoral thesis on grey-box identification of ship roll with few sensors (closed-loop instrumental variables,
several load conditions), chapters 4 to 6.
"""

from expdesign.roll.estimate import RollEstimate, estimate_roll, fitted_pendulum, metacentric_height
from expdesign.roll.model import (
    MEANINGS,
    PARAMETERS,
    UNITS,
    coefficients,
    discrete,
    froude_scaled,
    named,
    parameters,
    relative_sensitivity,
    roll_frequency,
    stiffness,
)
from expdesign.roll.null_space import Direction, NullSpace, cures, direction, null_space, open_directions
from expdesign.roll.problem import RollProblem, build_problem
from expdesign.roll.runs import EFFECTS, Case, LowPass, Run, low_pass, prepared
from expdesign.vessel.roll import G_MPS2, NOMINAL, Body, Load, axis_inertia, first_moment, sensed_inertia
