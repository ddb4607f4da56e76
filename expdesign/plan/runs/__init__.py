"""Runs as the planner places them: footprint of the hull, dispersion of drawn ships."""

from expdesign.plan.runs.dispersion import draw_truths, run_at_headings, stray_m
from expdesign.plan.runs.ensemble import Fleet

__all__ = [
    "Fleet",
    "draw_truths",
    "run_at_headings",
    "stray_m",
]
