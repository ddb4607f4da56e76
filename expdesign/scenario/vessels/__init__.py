"""Vessel files, and the weather that vessel and scenario files state."""

from expdesign.scenario.vessels.vessel_file import load_vessel, vessel_of
from expdesign.scenario.vessels.vessel_tables import EnvironmentTable, build_environment
