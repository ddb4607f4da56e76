"""Growing the dictionary: the manoeuvre that adds most information is added, and the time shared out again."""

from expdesign.growing.loop import grow_dictionary
from expdesign.growing.optimum import optimum, shared
from expdesign.growing.values import GrowRound, GrowSettings, Growth

__all__ = ["GrowRound", "GrowSettings", "Growth", "grow_dictionary", "optimum", "shared"]
