"""The story of the package: from a scenario file to a folder of results, one function for each command.

Each function reads its input, does the work and only then writes, so that a failure leaves no files. The pieces in
between (`scored`, `designed`, `planned`) are for notebooks: value in, value out.
"""

from expdesign.workflows.after import estimate, export, measured, simulate
from expdesign.workflows.design import designed, duration_problem
from expdesign.workflows.diagnosed import diagnose
from expdesign.workflows.indices import check_routes, indices
from expdesign.workflows.mined import mine
from expdesign.workflows.outcome import Outcome, Progress, TextTable
from expdesign.workflows.replan import replan
from expdesign.workflows.trial import durations, plan, planned, run, score, scored
from expdesign.workflows.validated import validate_design
from expdesign.workflows.whatif import whatif

__all__ = [
    "Outcome",
    "Progress",
    "TextTable",
    "check_routes",
    "designed",
    "diagnose",
    "duration_problem",
    "durations",
    "estimate",
    "export",
    "indices",
    "measured",
    "mine",
    "plan",
    "planned",
    "replan",
    "run",
    "score",
    "scored",
    "simulate",
    "validate_design",
    "whatif",
]
