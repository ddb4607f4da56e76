"""The shortest day: runs, their places and the legs between them that together tell enough, in the least time."""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.shortest_day.accuracy import Accuracy, stated_accuracy
    from expdesign.shortest_day.alternate import check_way_fits, fullest_day, shortest_day
    from expdesign.shortest_day.cheapest import cheapest_runs
    from expdesign.shortest_day.manoeuvres import manoeuvres_worth_adding
    from expdesign.shortest_day.values import AccuracySettings, ShortestDay
else:
    __getattr__, __all__ = load_on_use(__name__, __file__)
