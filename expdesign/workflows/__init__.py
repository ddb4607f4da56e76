"""The story of the package: one function for each command of the command line.

Each function reads its input, does the work and only then writes, so that a failure leaves no files. For notebooks
there are the steps that commands share (`scored`, `designed`, `planned`: values in, values out) and `notebook`, a
planned trial as one value. `carry_out` does what a value of `expdesign.requests` asks. A name is loaded when it is
first used, so that a command waits only for what it needs.
"""

from typing import TYPE_CHECKING

from expdesign.lazy import load_on_use

if TYPE_CHECKING:
    from expdesign.workflows.commands.diagnose import diagnose
    from expdesign.workflows.commands.durations import durations, score
    from expdesign.workflows.commands.estimate import estimate
    from expdesign.workflows.commands.explain import explain
    from expdesign.workflows.commands.foresee import foresee
    from expdesign.workflows.commands.identify_steps import identify_steps
    from expdesign.workflows.commands.import_logs import import_logs
    from expdesign.workflows.commands.indices import indices
    from expdesign.workflows.commands.mine import mine
    from expdesign.workflows.commands.monitor import monitor
    from expdesign.workflows.commands.new import new
    from expdesign.workflows.commands.nominal import nominal
    from expdesign.workflows.commands.replan import replan
    from expdesign.workflows.commands.roll import incline, roll
    from expdesign.workflows.commands.roll_plan import roll_plan
    from expdesign.workflows.commands.run import plan, run
    from expdesign.workflows.commands.simulate import simulate
    from expdesign.workflows.commands.validate import validate_design
    from expdesign.workflows.commands.watch_steps import watch_steps
    from expdesign.workflows.commands.whatif import whatif
    from expdesign.workflows.commands.written_plan import check_routes, export, trial_result
    from expdesign.workflows.outcome import Outcome, carry_out
    from expdesign.workflows.steps.design_problem import designed, duration_problem
    from expdesign.workflows.steps.measured import measured
    from expdesign.workflows.steps.planned import plan_problem, planned
    from expdesign.workflows.steps.scored import scored
else:
    __getattr__, __all__ = load_on_use(__name__, __file__)
