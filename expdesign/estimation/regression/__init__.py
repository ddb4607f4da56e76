"""Measured batches as a linear regression."""

from expdesign.estimation.regression.current import STEADY_CURRENT, Guess, slopes
from expdesign.estimation.regression.nuisance import DIFFERENCE, EAST, NORTH, PRODUCT, Share, batch_signs
from expdesign.estimation.regression.polynomial import Polynomial, SignalTable, lift, symbol
from expdesign.estimation.regression.predictors import (
    CURRENT,
    PREDICTORS,
    Layout,
    build_layout,
)
from expdesign.estimation.regression.regression import Integers, Mask, Regression, batch_slices, single_output
from expdesign.estimation.regression.rows import Rows, build_regression, headings_at, room_for
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
    "drive_width",
    "heading_of",
    "headings_at",
    "in_depth",
    "inputs_of",
    "inputs_within",
    "lift",
    "measured_table",
    "model_for",
    "parts_of",
    "room_for",
    "signal_table",
    "single_output",
    "slopes",
    "subtract_mean",
    "symbol",
    "with_depth",
    "with_wind_as_measured",
]
