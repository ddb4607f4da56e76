"""Measured batches as a linear regression."""

from expdesign.estimation.regression.current import STEADY_CURRENT, Guess, slopes
from expdesign.estimation.regression.nuisance import DIFFERENCE, EAST, NORTH, PRODUCT, Share, batch_signs
from expdesign.estimation.regression.polynomial import Polynomial, SignalTable, lift, symbol
from expdesign.estimation.regression.predictors import (
    CURRENT,
    PREDICTORS,
    Layout,
    Rows,
    build_layout,
    build_regression,
    headings_at,
    room_for,
)
from expdesign.estimation.regression.regression import Integers, Mask, Regression, batch_slices, single_output
from expdesign.estimation.regression.tables import (
    AIR,
    VANE,
    Table,
    drive_of,
    heading_of,
    in_depth,
    inputs_of,
    measured_table,
    model_for,
    signal_table,
    with_depth,
)
from expdesign.estimation.regression.vane import with_wind_as_measured
from expdesign.estimation.regression.zero_mean import MEANS, subtract_mean

__all__ = [
    "AIR",
    "CURRENT",
    "DIFFERENCE",
    "EAST",
    "MEANS",
    "NORTH",
    "PREDICTORS",
    "PRODUCT",
    "STEADY_CURRENT",
    "VANE",
    "Guess",
    "Integers",
    "Layout",
    "Mask",
    "Polynomial",
    "Regression",
    "Rows",
    "Share",
    "SignalTable",
    "Table",
    "batch_signs",
    "batch_slices",
    "build_layout",
    "build_regression",
    "drive_of",
    "heading_of",
    "headings_at",
    "in_depth",
    "inputs_of",
    "lift",
    "measured_table",
    "model_for",
    "room_for",
    "signal_table",
    "single_output",
    "slopes",
    "subtract_mean",
    "symbol",
    "with_depth",
    "with_wind_as_measured",
]
