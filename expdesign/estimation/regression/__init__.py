"""Measured batches as a linear regression."""

from expdesign.estimation.regression.nuisance import (
    DIFFERENCE,
    EAST,
    NORTH,
    PRODUCT,
    STEADY_CURRENT,
    Guess,
    Share,
    batch_signs,
    slopes,
    with_wind_as_measured,
)
from expdesign.estimation.regression.polynomial import Polynomial, SignalTable, lift, symbol
from expdesign.estimation.regression.predictors import (
    CURRENT,
    NOTHING,
    PREDICTORS,
    STEADY,
    UNKNOWN,
    Layout,
    Predictor,
    Rows,
    build_layout,
    build_regression,
    headings_at,
    room_for,
)
from expdesign.estimation.regression.regression import (
    MEANS,
    Integers,
    Regression,
    batch_slices,
    single_output,
    subtract_mean,
)
from expdesign.estimation.regression.tables import (
    AIR,
    VANE,
    Table,
    drive_of,
    drive_width,
    heading_of,
    in_depth,
    inputs_of,
    inputs_within,
    measured_table,
    model_for,
    parts_of,
    signal_table,
    with_depth,
)
