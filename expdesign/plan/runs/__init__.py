"""Runs as the planner places them: footprint of the swept hull, dispersion of drawn ships."""

from expdesign.plan.runs.dispersion import dispersion_m, draw_truths, draws_for, run_at_headings
from expdesign.plan.runs.ensemble import Fleet
from expdesign.plan.runs.footprint import Footprint, footprint

__all__ = [
    "Fleet",
    "Footprint",
    "dispersion_m",
    "draw_truths",
    "draws_for",
    "footprint",
    "run_at_headings",
]
