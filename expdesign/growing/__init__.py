"""Growing the dictionary: the manoeuvre that adds most information is added, and the time shared out again."""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.growing.loop import grow_dictionary
    from expdesign.growing.optimal_design import optimum, shared
    from expdesign.growing.values import GrowRound, GrowSettings, Growth

__all__ = ["GrowRound", "GrowSettings", "Growth", "grow_dictionary", "optimum", "shared"]

if not TYPE_CHECKING:
    __getattr__ = load_on_use(
        __name__,
        {
            "loop": ("grow_dictionary",),
            "optimal_design": ("optimum", "shared"),
            "values": ("GrowRound", "GrowSettings", "Growth"),
        },
    )
