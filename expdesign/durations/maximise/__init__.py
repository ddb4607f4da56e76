"""Concave problems solved: by a working set, by Newton's method, or as conic problems."""

from expdesign.durations.maximise.large_scale import LargeDesign, d_optimal, rows_of
from expdesign.durations.maximise.maximise import Optimum, maximised

__all__ = ["LargeDesign", "Optimum", "d_optimal", "maximised", "rows_of"]
