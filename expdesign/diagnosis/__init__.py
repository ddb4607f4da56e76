"""Diagnosis: the errors of a simulation on measured data, their causes, and the gain from adding these to the model.

    found = diagnose(vessel, record, seed=0)
    found.findings[0].cause, found.extended

Windows of the data are simulated from free initial states. Autoregressions whiten the error; a varying current is a
random effect. The whitened error is compared with the sensitivity to every cause of the catalogue (`causes.CAUSES`).
Uncertain parameters, within their standard deviations, and initial states are nuisance parameters of every test.
Regressors are simulated, not measured, so measurement noise causes no bias. The best causes are fitted together with
the nuisance parameters. One cause is added at a time until none is significant. Gains are measured on held-out
batches.

Sources: L. Ljung, System Identification, 2nd ed. (1999), chapters 7 and 16; C. R. Rao (1948) for score tests;
P. H. Westfall and S. S. Young (1993) for the correction for multiple tests.
"""

from expdesign.diagnosis.accuracy import Accuracy
from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.diagnose import diagnose
from expdesign.diagnosis.discriminating_manoeuvre import Proposal
from expdesign.diagnosis.values import Diagnosis, Estimate, Finding, Lead, Unexplained
