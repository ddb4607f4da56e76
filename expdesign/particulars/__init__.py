"""A ship as her owner knows her: from particulars and trial values of a card to a vessel with honest scatter."""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.particulars.assumptions import Assumed, assumed
    from expdesign.particulars.card import (
        SCATTER,
        WATER_KGPM3,
        Card,
        Hull,
        Rudder,
        Stated,
        Thruster,
        Trial,
        Windage,
    )
    from expdesign.particulars.fit import Found, Nominal, Predicted, nominal, shown
    from expdesign.particulars.hull import FACTORS, is_usual
    from expdesign.particulars.intervals import Expected, expected, standard_trials
else:
    __getattr__, __all__ = load_on_use(__name__, __file__)
