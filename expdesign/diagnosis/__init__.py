"""Diagnosis: what a simulation gets wrong on measured data, why, and what mending it gains.

    found = diagnose(vessel, record, seed=0)
    found.findings[0].cause, found.extended

Windows of the data are simulated from free initial states. The error, freed of colour by autoregressions and of a
wandering current as a random effect, is compared with the answer to every cause of the catalogue (`causes.CAUSES`);
uncertain parameters, within their standard deviations, and initial states are nuisance to every test. Regressors are
simulated, not measured, so noise in the measurements does not bias anything. The best causes are fitted with all
nuisance and one is added at a time until chance explains as much; gains are measured on batches held out.

Sources: L. Ljung, System Identification, 2nd ed. (1999), chapters 7 and 16; C. R. Rao (1948) for score tests;
P. H. Westfall and S. S. Young (1993) for the correction for trying many.
"""

from expdesign.diagnosis.accuracy import Accuracy
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.diagnose import diagnose
from expdesign.diagnosis.discriminating_manoeuvre import Proposal
from expdesign.diagnosis.values import Diagnosis, Estimate, Finding

__all__ = ["CAUSES", "Accuracy", "Diagnosis", "Estimate", "Finding", "Proposal", "diagnose"]
