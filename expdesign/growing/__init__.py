"""Growing the dictionary: the manoeuvre that adds most information is added, and the time shared out again."""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.growing.loop import grow_dictionary, motion_limits, optimum, searched_spaces, shared
    from expdesign.growing.search import Archive, Candidate, Measure, Worth, pool_of, refined
    from expdesign.growing.space import FamilySpace, GrowRound, GrowSettings, Growth

__all__ = [
    "Archive",
    "Candidate",
    "FamilySpace",
    "GrowRound",
    "GrowSettings",
    "Growth",
    "Measure",
    "Worth",
    "grow_dictionary",
    "motion_limits",
    "optimum",
    "pool_of",
    "refined",
    "searched_spaces",
    "shared",
]

if not TYPE_CHECKING:
    __getattr__ = load_on_use(
        __name__,
        {
            "loop": (
                "grow_dictionary",
                "motion_limits",
                "optimum",
                "searched_spaces",
                "shared",
            ),
            "search": (
                "Archive",
                "Candidate",
                "Measure",
                "Worth",
                "pool_of",
                "refined",
            ),
            "space": (
                "FamilySpace",
                "GrowRound",
                "GrowSettings",
                "Growth",
            ),
        },
    )
