"""Measured data: CSV files are checked and cut into batches; velocities are measured or derived from pose.

One file has one header row (row 1 in every message) and one row per sample. Columns carry their unit in the name:

- `time_s` from any origin, increasing; a gap over 1.5 sample times starts a new batch, so does a change of `batch`;
- `u_mps v_mps r_radps`, velocity over ground in the b-frame;
- `north_m east_m` or `lat_deg lon_deg`, and `heading_rad` or `heading_deg`, clockwise from north, wrapped or not;
- inputs `tau_x tau_y tau_psi`, or per actuator `n1_rps a1_rad rudder1_rad ...`;
- relative wind `wind_u_mps wind_v_mps` (ship's velocity through the air), or of a vane `wind_speed_mps wind_angle_rad`,
  the direction it comes from, clockwise from the bow: u_q = V cos, v_q = V sin;
- `depth_m`, water depth;
- `roll_rad roll_rate_radps sway_acceleration_mps2 lateral_acceleration_mps2`, and the force of all actuators
  `actuator_x_n actuator_y_n actuator_psi_nm`;
- `manoeuvre`, a text that labels the row, which only `row_labels` reads.

Known quantities in other units (`u_knots`, `n1_rpm`, `wind_angle_deg`) are converted and noted; unknown columns
are ignored and noted. Every error is a `FileError` with the rows concerned.
"""

from expdesign.records.file import COLUMNS
from expdesign.records.limits import check_limits, column_limits
from expdesign.records.load import load_records, read_levels, row_labels
from expdesign.records.pieces import STREAM, Piece, Taken, as_file, pieces
from expdesign.records.pose import (
    VELOCITY_METHODS,
    Fix,
    central_difference,
    last_fix,
    mirrored_heading,
    smoothed_velocity,
)
