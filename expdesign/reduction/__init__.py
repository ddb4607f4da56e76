"""Reduction: measured data as they would be at the ship's reference point, with the inputs that actuators deliver.

What the vessel file states of actuators and sensors is undone once, here, for every command that reads data:

    record as measured, vessel  ->  record of the reference point, delivered inputs, remarks

Lags, dead times, dead bands and misalignments act on inputs as in simulation (`simulation.deliver`). The steps of
`simulation.sensors.observe` are undone in reverse: time, own axes and scale, place.
"""

from expdesign.reduction.reduce import (
    at_reference_point,
    averaged,
    readings_by_sensor,
    reduced,
    samples_of_a_mean,
    with_delivered_inputs,
    with_reduced_wind,
)
from expdesign.reduction.uncertain_times import TIMES
