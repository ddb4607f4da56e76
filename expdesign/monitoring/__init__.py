"""Monitoring: whether a ship in operation still is the ship of its model, and if not, what changed and since when.

    calibration = calibrate(grams_of(ship, reference, changes))        a period in which the ship was as known
    state, alarms, steps = watch(calibration, state, grams_of(...))     for as long as there are data

Data are cut into short stretches. Each is simulated from a free initial state under an unmeasured force with the
covariance that the reference shows. The error of the simulation, compared with its sensitivities to every change that
is watched for, gives the score and the information of the stretch. Sums of log-likelihood ratios of these changes,
begun anew whenever they fall below zero, raise the alarm (CUSUM). Stretches without information, as in steady transit,
add nothing to the sums.

Sources: E. S. Page, Biometrika 41 (1954), 100-115; G. Lorden, Annals of Mathematical Statistics 42 (1971), 1897-1908;
M. Basseville and I. V. Nikiforov, Detection of Abrupt Changes (1993), chapters 2 and 8 for the local approach.
"""

from expdesign.monitoring.alarms import AS_LIKELY, TOLD_APART, Again
from expdesign.monitoring.calibration import Calibration, calibrate
from expdesign.monitoring.changes import EQUATIONS, Change, watched_changes, watched_ship
from expdesign.monitoring.cusum import calls_of, estimates, soonest, threshold, watch
from expdesign.monitoring.evidence import KINDS, Grams, grams_and_noise, grams_of, joined, later_part, stretch_length
from expdesign.monitoring.noise import WHITE, Noise
from expdesign.monitoring.rolled import RollEvent, RollWatch, roll_learnt, roll_watched
from expdesign.monitoring.state import Alarm, Call, Rules, State, Step
