"""Causes in water and air."""

from expdesign.diagnosis.causes.environment.current import CURRENT
from expdesign.diagnosis.causes.environment.shallow_water import SHALLOW_WATER
from expdesign.diagnosis.causes.environment.wind import WIND

__all__ = ["CURRENT", "SHALLOW_WATER", "WIND"]
