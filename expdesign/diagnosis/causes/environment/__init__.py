"""Causes in water and air."""

from expdesign.diagnosis.causes.environment.current import CURRENT
from expdesign.diagnosis.causes.environment.shallow_water import SHALLOW_WATER
from expdesign.diagnosis.causes.environment.wind import WIND, wind_can_be_told

__all__ = ["CURRENT", "SHALLOW_WATER", "WIND", "wind_can_be_told"]
