"""Growing the dictionary: the manoeuvre that adds most information is added, and the time shared out again."""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.growing.loop import grow_dictionary, motion_limits, optimum, searched_spaces, shared
    from expdesign.growing.search import (
        Archive,
        Candidate,
        FamilySpace,
        GrowRound,
        GrowSettings,
        Growth,
        Measure,
        Worth,
        pool_of,
        refined,
    )
else:
    __getattr__, __all__ = load_on_use(__name__, __file__)
