"""Runs as the planner places them: footprint of the swept hull, dispersion of drawn ships."""

from expdesign.plan.runs.dispersion import dispersion_m, draw_truths, run_at_headings
from expdesign.plan.runs.ensemble import Fleet
from expdesign.plan.runs.footprint import Footprint, footprint

__all__ = [
    "Fleet",
    "Footprint",
    "dispersion_m",
    "draw_truths",
    "footprint",
    "run_at_headings",
]
