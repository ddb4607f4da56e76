"""What every command is asked: each of its options once, with name, type, help and default.

The command line is made of these values, and so is the line that repeats a call.
"""

from __future__ import annotations

import shlex
from collections.abc import Collection
from dataclasses import dataclass

from expdesign.requests.options import Argument, Request
from expdesign.requests.planning import CheckRoute, Durations, Export, New, Nominal, Plan, RollPlan, Run, Score, WhatIf
from expdesign.requests.recorded import Diagnose, Estimate, IdentifySteps, Import, Indices, Mine, Monitor, WatchSteps
from expdesign.requests.trials import Foresee, Incline, Replan, Roll, Simulate, TrialResult, Validate


@dataclass(frozen=True, kw_only=True)
class Command:
    """A command: its name, and the workflow that carries it out."""

    name: str  # on the command line
    request: type[Request]
    workflow: str  # name in `expdesign.workflows`
    tells: bool = False  # whether the workflow also takes `tell`, for lines that are printed while it works


def _command(name: str, request: type[Request], *, workflow: str = "", tells: bool = False) -> Command:
    return Command(name=name, request=request, workflow=workflow or name.replace("-", "_"), tells=tells)


COMMANDS = (
    _command("new", New),
    _command("run", Run),
    _command("nominal", Nominal),
    _command("score", Score),
    _command("durations", Durations),
    _command("plan", Plan),
    _command("export", Export),
    _command("check-route", CheckRoute, workflow="check_routes"),
    _command("whatif", WhatIf),
    _command("roll-plan", RollPlan),
    _command("import", Import, workflow="import_logs"),
    _command("estimate", Estimate),
    _command("diagnose", Diagnose),
    _command("indices", Indices),
    _command("identify-steps", IdentifySteps),
    _command("mine", Mine),
    _command("monitor", Monitor),
    _command("watch-steps", WatchSteps, tells=True),
    _command("foresee", Foresee),
    _command("simulate", Simulate),
    _command("validate", Validate, workflow="validate_design"),
    _command("trial-result", TrialResult),
    _command("replan", Replan),
    _command("roll", Roll),
    _command("incline", Incline),
)
"""In the order in which `--help` lists them."""


def command_of(request: Request) -> Command:
    """The command that carries out a request."""
    return next(one for one in COMMANDS if one.request is type(request))


def command_text(request: Request) -> str:
    """`expdesign COMMAND ARGUMENTS OPTIONS`, ready to be typed; options with their usual values are left out."""
    command = command_of(request)
    arguments, options = list[str](), list[str]()
    for one in command.request.asked():
        value = getattr(request, one.name)
        words = [f"{item:g}" if isinstance(item, float) else str(item) for item in _listed(value)]
        if isinstance(one.typed, Argument):
            arguments += words
        elif value != one.default or one.typed.stated:
            options += [one.flag, *words]
    return shlex.join(["expdesign", command.name, *arguments, *options])


WITHOUT_EFFECT = ("out", "jobs", "scheduler", "no_cache")  # values on which no result depends


def repeating(request: Request, *, keep: Collection[str] = ()) -> str:
    """The command that gives the same results again, without values that have no effect on them; some may be kept."""
    usual = {one.name: one.default for one in request.asked() if one.name in WITHOUT_EFFECT and one.name not in keep}
    return command_text(request.but(**usual))


def _listed(value: object) -> tuple[object, ...]:
    """The words of a value: none of a flag."""
    return value if isinstance(value, tuple) else () if isinstance(value, bool) else (value,)
