"""Runs as the planner places them: footprint of the swept hull, dispersion of drawn ships."""

from expdesign.plan.runs.dispersion import Footprint, dispersion_m, draw_truths, draws_for, footprint, run_at_headings
from expdesign.plan.runs.ensemble import Fleet
