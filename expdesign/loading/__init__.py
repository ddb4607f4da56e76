"""Load trials: which known loads, and which manoeuvres at each, tell most about a ship's roll; and inclining tests.

    vessel with [roll], candidate loads, dictionary -> run_information -> choose_loads -> LoadPlan
    ship, shifted mass -> inclining

Parameters, frames and signs are those of `roll`; parameters that the vessel file states a standard deviation for are
free, the others count as known.
"""

from expdesign.loading.choice import LoadOption, LoadPlan, Question, build_question, choose_loads, run_information
from expdesign.loading.inclining import Inclining, heel_in_waves, heel_of_shift, inclining
