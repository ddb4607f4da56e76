"""One file of measured data: header, cells, columns, clock, ranges."""

from expdesign.records.file.cells import FIRST_ROW, read_cells
from expdesign.records.file.checks import GAP_SAMPLE_TIMES, JITTER_SHARE, Clock, check_ranges, read_clock
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
    Inputs,
    Source,
    Sources,
    choose_columns,
    input_name,
    is_input,
    is_turning_input,
    meaning,
    mistyped,
)
from expdesign.records.file.table import MISSING, Table, check_wind, read_table, relative_wind
