"""Logs of ships and craft become files that this package reads; every decision is told, kept and may be changed.

    log -> channels (name, unit, times, readings)                readers
        -> columns of ours, in our units and senses               mapping: as a file says, or a guess by names,
                                                                  readings and machines
        -> one time scale for all files                           alignment
        -> even steps without gaps                                sampling
        -> runs                                                   runs
        -> what each is, in words                                 labels
    beside: how actuators follow their orders                     responses
            noise, rounding and interval of each sensor           noise

Times count from 1970 UTC where a clock has a date. Angles are in radians, headings clockwise from north.
"""

from expdesign.importing.alignment import lag_of, zone_lag_of
from expdesign.importing.channels import COMPUTER, GNSS, NONE, OWN, Channel, Log, joined
from expdesign.importing.guess import guess
from expdesign.importing.mapping import FileClock, Mapping
from expdesign.importing.names import bow_signals, sides
from expdesign.importing.readers import READERS, read_log
from expdesign.importing.responses import Followed, followed, sensor_keys
from expdesign.importing.runs import (
    Run,
    cut,
    cut_by_plan,
    family,
    file_name,
    fitted,
    inputs_of,
    length_of_speed_m,
    presumed,
    typical_length_m,
)
from expdesign.importing.sampling import NothingToWrite, Sampled, Stretch, sampled
