"""Instruments of a record against each other and against the inputs, before any model is fitted.

    record as measured, vessel  ->  record with readings at their own times, and notes on what does not agree

Held and interpolated signals are found and read in time (`held`); gyro, compass, log and positions are compared
(`instruments`), each by an estimate with its standard error and what is left; the ship should answer her inputs in the
sense that the vessel file gives (`steering`). Everything is told. Changed are the times of readings, and, unless
it is watched for, what two instruments show of a third in all files together: the scale of a gyro or log, and how late
a log is.
"""

from expdesign.kinematics.check import checked, in_doubt, in_stated_time
from expdesign.kinematics.held import held
