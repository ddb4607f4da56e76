"""What a diagnosis of a trial would find, before it is sailed.

    found = foresee(vessel, design_runs(primitives, repeats), weather, seed=0)
    found.effects[0].power

The trial is simulated with nothing hidden, and a diagnosis of it is begun: its fit, its noise, its candidates and the
number of its tests. The sensitivity of the simulated outputs to every cause of the catalogue, beside uncertain
parameters, initial states and a wandering current, gives the noncentrality of the cause's test at a size that matters.
Power follows from the noncentral chi-squared distribution, at the level that a diagnosis accepts a cause at.

A size matters where it changes the advance, the tactical diameter or a first overshoot of the vessel's own standard
trials by 5 % (overshoots by half a degree or more), or costs 5 points of fit in simulating them, whichever is less.
Parameters and effects with a stated standard deviation matter from three of these on. Where standard trials show
nothing of an effect, a default counts (`sizes.default_sizes`).

Effects act as a whole along the nominal path, and the motion answers linearly. The true ship is the nominal one with
parameters as wrong as their standard deviations say. Sizes with the wanted power are in proportion. A diagnosis also
asks that a cause improves the simulation or the prediction of held-out runs. How often it does where the test accepts
it is drawn: effects are estimated without each fold of the runs, by the information of the others.

Sources: A. Wald (1943) for the noncentral distribution; C. R. Rao (1948) for score tests.
"""

from expdesign.foresight.effects import default_sizes, with_effect
from expdesign.foresight.foresee import foresee
from expdesign.foresight.operation import Detectability, OperationForesight, foresee_operation, interval
from expdesign.foresight.power import level_of, needed_noncentrality, power
from expdesign.foresight.reveal import Wanted, causes_by_runs, told_apart_from, told_apart_with, wanted
from expdesign.foresight.trial import TrialRun, background, design_runs, simulated_record, weather_without_causes
from expdesign.foresight.values import TOLD_APART, AddedRuns, Foreseen, Foresight
