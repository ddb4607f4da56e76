"""The story of the package: one function for each command of the command line.

Each function reads its input, does the work and only then writes, so that a failure leaves no files. For notebooks
there are the steps that commands share (`scored`, `designed`, `planned`: values in, values out) and `notebook`, a
planned trial as one value. A name is loaded when it is first used, so that a command waits only for what it needs.
"""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.workflows.data.diagnose import diagnose
    from expdesign.workflows.data.estimate import estimate
    from expdesign.workflows.data.identify_steps import identify_steps
    from expdesign.workflows.data.import_logs import import_logs
    from expdesign.workflows.data.indices import indices
    from expdesign.workflows.data.mine import mine
    from expdesign.workflows.data.monitor import monitor
    from expdesign.workflows.data.watch_steps import watch_steps
    from expdesign.workflows.explanations.explain import explain
    from expdesign.workflows.outcome import Outcome
    from expdesign.workflows.planning.durations import durations
    from expdesign.workflows.planning.export import check_routes, export
    from expdesign.workflows.planning.new import new
    from expdesign.workflows.planning.nominal import nominal
    from expdesign.workflows.planning.plan import plan
    from expdesign.workflows.planning.roll_plan import roll_plan
    from expdesign.workflows.planning.run import run
    from expdesign.workflows.planning.score import score
    from expdesign.workflows.planning.whatif import whatif
    from expdesign.workflows.steps.design_problem import designed, duration_problem
    from expdesign.workflows.steps.measured import measured
    from expdesign.workflows.steps.planned import plan_problem, planned
    from expdesign.workflows.steps.scored import scored
    from expdesign.workflows.trials.foresee import foresee
    from expdesign.workflows.trials.incline import incline
    from expdesign.workflows.trials.replan import replan
    from expdesign.workflows.trials.result import trial_result
    from expdesign.workflows.trials.roll import roll
    from expdesign.workflows.trials.simulate import simulate
    from expdesign.workflows.trials.validate import validate_design
else:
    __getattr__, __all__ = load_on_use(__name__, __file__)
