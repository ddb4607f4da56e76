"""Commands that watch a ship: in operation, and during a step trial."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from expdesign.requests.options import (
    Argument,
    Jobs,
    Option,
    OutByData,
    Request,
    Resume,
    Rudder,
    Seed,
    Throttle,
    Velocity,
)


class Monitor(Request):
    """Watch a ship in operation: whether it still is the ship of its model, what changed, since when, by how much.

    Writes monitor.json, monitor.html, monitor-state.json and, after an alarm, since-change.csv for diagnose.

    Example: expdesign monitor voyage.csv --vessel ship.toml --learn-h 6
    """

    data: Annotated[
        tuple[Path, ...],
        Argument(metavar="DATA.csv ...", help="Records of operation in the order of time; - reads a stream."),
    ]
    vessel: Annotated[Path, Option(metavar="VESSEL.toml", help="The model of the ship.")]
    reference: Annotated[
        tuple[Path, ...],
        Option(
            metavar="FILE ...",
            help="Records of a time in which the ship was as known, in weather as usual.",
        ),
    ] = ()
    learn_h: Annotated[
        float,
        Option(metavar="H", over=0.0, help="Hours of the data that are the reference, where none is given."),
    ] = 24.0
    false_alarm_days: Annotated[float, Option(metavar="D", over=0.0, help="Days between false alarms, on average.")] = (
        30.0
    )
    size: Annotated[
        float,
        Option(
            metavar="S",
            help="Relative change of parameters, thrust and inertia that matters; of angles and gyro in proportion.",
        ),
    ] = 0.1
    every_s: Annotated[float, Option(metavar="T", over=0.0, help="Seconds of a stream between looks at it.")] = 3600.0
    model: Annotated[
        Literal["vessel", "yaw-full", "yaw-simplified"],
        Option(
            metavar="WHICH",
            help="Model that is watched: vessel, the vessel file's; yaw-full or yaw-simplified, learnt from the "
            "reference, with measured surge, sway, roll, side acceleration and moment of the drives as inputs.",
        ),
    ] = "vessel"
    port_h: Annotated[
        float,
        Option(
            metavar="H",
            help="Hours without way and propulsion, or without data, that count as a port call: the ship may carry "
            "another load afterwards, which is estimated anew and raises no alarm. inf: its load never changes.",
        ),
    ] = 1.0
    resume: Resume = False
    velocity: Velocity = "auto"
    out: OutByData = None
    jobs: Jobs = 0


class WatchSteps(Request):
    """Tell during a step trial when the vessel is steady and which step is next; list what is left to sail.

    One line for each event, at once. Bad steps are named and put to the end. Writes steps-to-do.csv, a list of steps
    for --steps, watch-steps.json and watch-steps-state.json for --resume.

    Example: expdesign watch-steps - --steps steps.csv --vessel fast-8m.toml
    """

    data: Annotated[Path, Argument(metavar="DATA.csv", help="Record of a step trial; - reads a stream, row by row.")]
    steps: Annotated[
        Path,
        Option(
            metavar="FILE",
            help="What is to be sailed: a CSV with one row for each hold and a column for every input (n1_rps, "
            "rudder1_rad); the plan.json of a trial; or a dictionary with families of steps (.toml).",
        ),
    ]
    vessel: Annotated[
        Path,
        Option(metavar="VESSEL.toml", help="The guess before the trial: inputs, and how fast it answers."),
    ]
    throttle: Throttle = ()
    rudder: Rudder = ()
    learn_s: Annotated[
        float | None,
        Option(
            metavar="T",
            over=0.0,
            help="Seconds of the first hold, from which the noise is learnt. Default: 120, or 80 % of the hold where "
            "it is planned to be shorter.",
        ),
    ] = None
    resume: Resume = False
    out: OutByData = None
    seed: Seed = 0
