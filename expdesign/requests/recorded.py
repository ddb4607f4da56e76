"""Commands on measured data, at once or while it comes in."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from expdesign.requests.options import (
    Argument,
    DataFiles,
    Fixed,
    Jobs,
    Mean,
    Option,
    OutByData,
    OutByLog,
    OutByVessel,
    Request,
    Resume,
    Rudder,
    Seed,
    StatedSeed,
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


class Import(Request):
    """Turn logs, as ships and craft record them, into runs that the other commands read.

    Writes a CSV file for each run, mapping.toml with all decisions, instruments.toml with what the logs tell of
    sensors and actuators, import.json and import.html. Every command that reads measured runs takes the folder,
    and uses instruments.toml where the vessel file says nothing.

    Example: expdesign import bridge.nmea rudder.csv --vessel ship.toml
    """

    logs: Annotated[
        tuple[Path, ...],
        Argument(metavar="LOG ...", help="Logs of one trial or voyage, in any formats: expdesign explain import."),
    ]
    vessel: Annotated[
        Path | None,
        Option(
            metavar="VESSEL.toml",
            help="Numbers thrusters and rudders as this file does, and holds the ship's answers against its model.",
        ),
    ] = None
    plan: Annotated[
        Path | None,
        Option(metavar="PLAN.json", help="Cut out the runs of this plan, by their names."),
    ] = None
    map_file: Annotated[
        Path | None,
        Option(
            "--map",
            metavar="MAPPING.toml",
            help="The mapping of an earlier import, edited; see expdesign explain mapping. Default: guessed.",
        ),
    ] = None
    sample_time_s: Annotated[
        float | None,
        Option(
            "--sample-time",
            metavar="S",
            over=0.0,
            help="Time between rows that are written [s]. Default: that of the slowest main sensor, at most 1.",
        ),
    ] = None
    length_m: Annotated[
        float | None,
        Option(metavar="L", over=0.0, help="Length of the ship [m]. Default: VESSEL.toml's, or by her speed."),
    ] = None
    out: OutByLog = None


class Estimate(Request):
    """Estimate the model's parameters from measured data, with standard errors.

    Writes estimate.json, vessel-estimated.toml and estimate.html.

    Example: expdesign estimate zigzag.csv circle.csv --vessel ship.toml --method ls iv --test other.csv
    """

    data: DataFiles
    vessel: Annotated[Path, Option(metavar="VESSEL.toml", help="Model structure, start values and sensors.")]
    methods: Annotated[
        tuple[str, ...],
        Option(
            "--method",
            metavar="M ...",
            help="Estimators, one or more of ls, iv and oe; or methods, which say what is known of the weather, too: "
            "expdesign explain methods. Default: ls, iv and oe, and those with wind where wind is measured and the "
            "model has terms for it. The vessel file takes the one that predicts best what it has not seen.",
        ),
    ] = ()
    unknown: Annotated[
        Literal["nothing", "current", "wind", "both", "steady-current"] | None,
        Option(
            metavar="WHAT",
            help="What of the weather is unknown and estimated beside the ship: nothing, current, wind, both, or "
            "steady-current; all estimators then use the wind that is measured. Default: what --method says.",
        ),
    ] = None
    fixed: Fixed = ()
    tests: Annotated[
        tuple[Path, ...],
        Option("--test", metavar="FILE ...", help="Runs held out: simulated, but not used to estimate."),
    ] = ()
    velocity: Velocity = "auto"
    mean: Mean = "complete"
    blocks: Annotated[
        Literal["one", "batch"],
        Option(
            metavar="HOW",
            help="Instruments of all runs in one block, or batch: a block for each run, weighted by its information, "
            "with --mean batch or none.",
        ),
    ] = "one"
    start: Annotated[
        Literal["auto", "nominal", "ls"],
        Option(
            metavar="HOW",
            help="Parameters that the first instruments are simulated with: nominal, the vessel file's; ls, least "
            "squares; auto: nominal, unless these are all zero or fail.",
        ),
    ] = "auto"
    motion: Annotated[
        Literal["continuous", "euler"],
        Option(
            metavar="WHAT",
            help="Motion that the parameters describe: continuous, as plans use it, or euler, "
            "Euler's map at the sample time.",
        ),
    ] = "continuous"
    horizon_s: Annotated[
        float | None,
        Option(
            "--horizon",
            metavar="SECONDS",
            help="Output error restarts its simulations from the data after this time, for ships unstable on their "
            "course and for weather that is not measured. Default: 30, or never, whichever predicts better.",
        ),
    ] = None
    constant: Annotated[bool, Option(help="Give every run a constant force of its own in output error.")] = False
    steered: Annotated[
        Literal["auto", "use", "leave-out", "planned"],
        Option(
            metavar="HOW",
            help="Samples that the data mark as steered: use; leave-out; planned, instruments from columns of planned "
            "inputs; auto: in methods with instruments planned where there are such columns, else leave-out.",
        ),
    ] = "auto"
    samples: Annotated[
        Literal["all", "equation-wise"],
        Option(
            metavar="HOW",
            help="Samples of each equation: all; equation-wise, those where what stands inside its absolute values is "
            "clear of zero in the simulated instruments, so that noise and disturbances leave no bias.",
        ),
    ] = "all"
    offset_mps: Annotated[
        float,
        Option(
            "--offset",
            metavar="MPS",
            help="Strongest current, and wind where it is not measured, that velocities must exceed in equation-wise "
            "samples [m/s], beside three standard deviations of the sensors.",
        ),
    ] = 0.0
    prior: Annotated[
        Literal["none", "parameter_std"],
        Option(
            metavar="HOW",
            help="parameter_std: join estimates with what the vessel file knew before, as after a step trial or an "
            "earlier estimate, of which these data must be no part; none.",
        ),
    ] = "none"
    out: OutByData = None


class Diagnose(Request):
    """Find the causes of the simulation error and extend the model by them.

    Writes diagnosis.json, diagnosis.html and vessel-extended.toml. The causes: expdesign explain causes

    Example: expdesign diagnose zigzag.csv circle.csv --vessel ship.toml
    """

    data: DataFiles
    vessel: Annotated[
        Path,
        Option(
            metavar="VESSEL.toml",
            help="The simulation model in use; parameter_std is the uncertainty of its parameters.",
        ),
    ]
    scenario: Annotated[
        Path | None,
        Option(
            metavar="SCENARIO.toml",
            help="Scenario whose dictionary is searched for manoeuvres that distinguish causes. Default: standard "
            "manoeuvres.",
        ),
    ] = None
    velocity: Velocity = "auto"
    out: OutByData = None
    jobs: Jobs = 0
    seed: StatedSeed = 0


MOST_WIND_MPS = 100.0  # of a mean wind; no trial is held in more


class Indices(Request):
    """Compute turning, zig-zag and stopping indices, simulated and measured, beside their IMO limits.

    Writes indices.json and indices.html.

    Example: expdesign indices zigzag.csv circle.csv --vessel ship.toml
    """

    vessel: Annotated[Path, Option(metavar="VESSEL.toml", help="Model, length and actuators of the ship.")]
    data: Annotated[
        tuple[Path, ...], Argument(metavar="DATA.csv ...", help="Measured zig-zags, turning circles, stops.")
    ] = ()
    speed_mps: Annotated[
        float | None,
        Option(metavar="V", help="Approach speed of the simulated trials. Default: 85 % power."),
    ] = None
    scale: Annotated[
        float, Option(metavar="S", min=1.0, help="Ship length by model length, for trials of a model.")
    ] = 1.0
    antenna_forward_m: Annotated[
        float,
        Option(metavar="X", help="Distance of the antenna forward of amidships [m]."),
    ] = 0.0
    depth_m: Annotated[
        float | None, Option(metavar="D", over=0.0, help="Depth of the water in the measured trials [m].")
    ] = None
    wind_mps: Annotated[
        float | None,
        Option(metavar="W", min=0.0, max=MOST_WIND_MPS, help="Mean true wind in the measured trials [m/s]."),
    ] = None
    sea_state: Annotated[
        int | None, Option(metavar="N", min=0, max=9, help="Sea state in the measured trials, by its code.")
    ] = None
    out: OutByVessel = None


class IdentifySteps(Request):
    """Identify a model of speed and yaw rate from steps of throttle and rudder, each held until the vessel is steady.

    Writes step-model.json, step-trial.html and, with --vessel, vessel-steps.toml: that vessel with the parameters,
    covariance and dead times that the steps leave, from which a trial is designed with prior = "parameter_std".

    Example: expdesign identify-steps steps.csv --vessel fast-8m.toml
    """

    data: DataFiles
    vessel: Annotated[
        Path | None,
        Option(
            metavar="VESSEL.toml",
            help="What is known of the vessel before the trial: its model with parameter_std. The steps update it.",
        ),
    ] = None
    throttle: Throttle = ()
    rudder: Rudder = ()
    tests: Annotated[
        tuple[Path, ...],
        Option("--test", metavar="FILE ...", help="Runs held out: simulated, but not used to identify."),
    ] = ()
    steps: Annotated[
        Path | None,
        Option(
            metavar="FILE",
            help="What was to be sailed, as in watch-steps, e.g. plan.json: only these steps are asked to be repeated.",
        ),
    ] = None
    velocity: Velocity = "auto"
    out: OutByData = None
    seed: Seed = 0


class Mine(Request):
    """Rank recorded runs by their information, and choose the few to estimate from.

    Writes mining.json and chosen.csv, which `estimate` reads. With --labels: dictionary.json, durations.json, and
    subsets.json with the simulation error of optimised and of random subsets on the pieces that they leave.

    Example: expdesign mine voyage.csv --vessel ship.toml --piece 120 --keep 10
    Example: expdesign mine trials --vessel ship.toml --labels file --piece 100 --keep 6
    """

    data: DataFiles
    vessel: Annotated[Path, Option(metavar="VESSEL.toml", help="Nominal model; its simulation gives instruments.")]
    keep: Annotated[int, Option(metavar="K", min=1, help="How many batches, or pieces, to choose.")]
    piece_s: Annotated[
        float | None,
        Option("--piece", metavar="SECONDS", help="Cut runs into pieces of about this length first."),
    ] = None
    fixed: Fixed = ()
    mean: Mean = "complete"
    velocity: Velocity = "auto"
    labels: Annotated[
        Literal["column", "file"] | None,
        Option(
            metavar="WHERE",
            help="Make a dictionary of labelled manoeuvres, share out K pieces of --piece seconds among them, and "
            "compare with random pieces. Labels are in the column manoeuvre (column), or before the first underscore "
            "of a file's name (file).",
        ),
    ] = None
    draws: Annotated[int, Option(metavar="N", min=2, help="With --labels: subsets drawn of each design.")] = 500
    out: OutByData = None
    seed: Seed = 0
