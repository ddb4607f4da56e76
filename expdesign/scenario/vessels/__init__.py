"""Vessel files, and the weather that vessel and scenario files state."""

from expdesign.scenario.vessels.environment_table import EnvironmentTable, build_environment
from expdesign.scenario.vessels.vessel_file import load_vessel

__all__ = ["EnvironmentTable", "build_environment", "load_vessel"]
