"""Experiment design for manoeuvring trials of ships.

From a vessel model, a dictionary of manoeuvres, a chart and the time for the trial: how informative each
manoeuvre is, how long to run each, and one trajectory from start to goal that runs them all in allowed water.

    from pathlib import Path
    from expdesign import workflows
    outcome = workflows.run(Path("scenarios/helsinki.toml"), Path("runs/helsinki"), seed=0, progress=lambda *_: None)

What every number means:

- Values are frozen; the arrays they hold are read-only, their shapes checked at birth.
- n-frame: north, east, down, fixed to the earth, origin at the reference point of the sea area. b-frame: forward,
  starboard, down, origin amidships.
- Pose: north [m], east [m], heading [rad], clockwise from north. Velocity: surge u [m/s], sway v [m/s], yaw rate
  r [rad/s], in the b-frame.
- Currents and winds are velocities *to* which the medium moves.
- SI units and radians; where a number crosses a border its unit is in the name (`length_m`, `heading_rad`). Degrees,
  knots, latitude and longitude appear only in files.
- Time counts from the start of the trial [s]; commands are held over one sample time.
- What is wrong raises `InputError`, what has no answer raises `NoAnswer` (`expdesign.errors`), each with one line.
- The same seed gives the same result. For that, linear algebra uses one thread, where OPENBLAS_NUM_THREADS says
  nothing else.
"""

from expdesign.threads import use_one_thread

use_one_thread()

__version__ = "0.2.0"
