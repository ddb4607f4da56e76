"""Concave problems solved: as stated by cvxpy, by working sets, or by Newton's method."""

from expdesign.durations.maximise.large_scale import LargeDesign, d_optimal, rows_of
from expdesign.durations.maximise.maximise import CVXPY, NEWTON, Optimum, maximised
