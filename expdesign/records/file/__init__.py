"""One file of measured data: header, cells, columns, clock, ranges."""

from expdesign.records.file.cells import FIRST_ROW, read_cells
from expdesign.records.file.choice import Inputs, Sources, choose_columns, mistyped
from expdesign.records.file.clock import JITTER_SHARE, Clock, read_clock
from expdesign.records.file.names import (
    ANGLE,
    COLUMNS,
    LABEL,
    PLANNED,
    REACHED,
    REVOLUTIONS,
    SPEED,
    STEERED,
    YAW_RATE,
    Source,
    input_name,
    is_input,
    is_turning_input,
    meaning,
)
from expdesign.records.file.ranges import check_ranges
from expdesign.records.file.table import MISSING, Table, check_wind, read_table, relative_wind
