"""Commands that run, test or continue a planned trial."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from expdesign.requests.options import (
    MOST_TRIALS,
    MOST_VOYAGES,
    Argument,
    DataFiles,
    Jobs,
    NoCache,
    Option,
    Out,
    OutBesidePlan,
    OutByData,
    OutInclined,
    PlanFile,
    Request,
    ScenarioFile,
    Scheduler,
    Seed,
    StatedSeed,
)


class Foresee(Request):
    """Foresee what a diagnosis of the trial would find: the power of its test of every cause, before sailing.

    Writes foresee.json and foresee.html: also causes that it would not tell apart, and runs that would help. With
    --operation: operation.json and operation.html, which changes a watch finds, after how long, and how it names them.
    The causes: expdesign explain causes

    Example: expdesign foresee mytrial/scenario.toml
    Example: expdesign foresee mytrial/scenario.toml --operation 10 --jobs 0
    """

    scenario: ScenarioFile
    plan: Annotated[
        Path | None,
        Option(
            metavar="PLAN.json",
            help="A plan made before, whose whole track is diagnosed. Default: the runs of the design alone.",
        ),
    ] = None
    operation: Annotated[
        int | None,
        Option(
            metavar="N",
            min=1,
            max=MOST_VOYAGES,
            help="Foresee instead what expdesign monitor would find of the ship in operation, by N simulated voyages "
            "of each change: inertia, mass, damping, thrust.",
        ),
    ] = None
    out: Out = None
    jobs: Jobs = 1
    no_cache: NoCache = False
    seed: StatedSeed = 0


class Simulate(Request):
    """Rehearse a trial: run its commands on another vessel and measure with noise.

    Writes measured.csv.
    """

    plan: PlanFile
    truth: Annotated[Path, Option(metavar="VESSEL.toml", help="The vessel that runs the trial, with its sensors.")]
    until_s: Annotated[
        float | None,
        Option("--until", metavar="S", over=0.0, help="End the data after S seconds, as if the trial were aborted."),
    ] = None
    out: OutBesidePlan = None
    seed: Seed = 0


class Validate(Request):
    """Test a design in simulated trials: predicted and simulated accuracy, beside equal shares and random runs.

    Writes validation.json and validation.html. An interrupted call continues where it stopped.
    """

    scenario: ScenarioFile
    truth: Annotated[
        Path | None,
        Option(metavar="VESSEL.toml", help="The true ship. Default: the scenario's own vessel."),
    ] = None
    trials: Annotated[
        int, Option(metavar="N", max=MOST_TRIALS, stated=True, help="Simulated trials of each design.")
    ] = 100
    method: Annotated[
        str | None,
        Option(
            metavar="M",
            help="Estimator; see expdesign explain methods. Default: iv, or with a steady current where the forecast "
            "leaves one unknown, iv-current or iv-air-current.",
        ),
    ] = None
    integrator: Annotated[
        Literal["rk4", "euler"],
        Option(
            stated=True,
            metavar="HOW",
            help="Motion between samples: rk4, or euler, the map by which discrete parameters are defined.",
        ),
    ] = "rk4"
    jobs: Jobs = 0
    scheduler: Scheduler = None
    out: Out = None
    seed: StatedSeed = 0


class TrialResult(Request):
    """Put what a trial promised beside what came out: one page for owner and class, with space to sign.

    Writes result.json and result.html: runs, accuracy of every parameter, indices and their limits.

    Example: expdesign trial-result runs/helsinki/plan.json --estimate runs/measured/estimate.json
    """

    plan: Annotated[Path, Argument(metavar="PLAN.json", help="The plan that was sailed.")]
    estimate: Annotated[
        Path,
        Option(metavar="ESTIMATE.json", help="What expdesign estimate found in the data."),
    ]
    indices: Annotated[
        Path | None,
        Option(metavar="INDICES.json", help="What expdesign indices found in them."),
    ] = None
    out: OutBesidePlan = None


class Replan(Request):
    """Plan the rest of a trial, from the present position, with a model updated from the data.

    Writes what run writes, for the rest; replan.json with what is known and what the rest will add; and
    vessel-used.toml, the model it is planned with. The rest begins with the motion and the commands of the last rows
    of the data, or with the ship stopped there.

    Example: expdesign replan mytrial/scenario.toml --data measured.csv --vessel vessel-extended.toml --remaining 480
    """

    scenario: ScenarioFile
    data: Annotated[
        tuple[Path, ...],
        Option(
            metavar="DATA.csv ...",
            help="Measured so far; the last row of the last file is the present position.",
        ),
    ]
    vessel: Annotated[
        Path | None,
        Option(
            metavar="VESSEL.toml",
            help="Model to continue with, e.g. vessel-extended.toml. Default: estimated from the data.",
        ),
    ] = None
    remaining_s: Annotated[
        float | None,
        Option(
            "--remaining",
            metavar="S",
            help="Informative time left [s]. Default: what design.accuracy still takes; without it design.total_s less "
            "the time of the data.",
        ),
    ] = None
    interest: Annotated[
        tuple[str, ...],
        Option(
            metavar="NAME ...",
            help="Parameters to optimise the rest for (criterion D_s), e.g. one that a diagnosis added.",
        ),
    ] = ()
    stopped: Annotated[
        bool,
        Option(help="The ship stops at the last position of the data before the rest begins."),
    ] = False
    out: Out = None
    jobs: Jobs = 0
    scheduler: Scheduler = None
    no_cache: NoCache = False
    seed: StatedSeed = 0


class Roll(Request):
    """Estimate roll inertia, damping, stiffness and an unknown load from runs at one or more loads.

    Reads roll_rate_radps, imu_lateral_mps2, r_radps and the rudder. Writes roll.json and roll.html: parameters with
    intervals, what the loads cannot tell apart, and what would; with --vessel also vessel-roll.toml, the ship with the
    estimate, which simulate and roll-plan take.

    Example: expdesign roll nominal.csv calibration.csv loaded.csv --loads loads.toml
    """

    data: DataFiles
    loads: Annotated[
        Path,
        Option(metavar="LOADS.toml", help="Load of each data file; see expdesign explain loads."),
    ]
    vessel: Annotated[
        Path | None,
        Option(metavar="VESSEL.toml", help="Ship with [roll], in place of [ship] in LOADS.toml."),
    ] = None
    rudder: Annotated[
        tuple[str, ...],
        Option(metavar="NAME ...", help="Signals whose mean steers. Default: rudders, else all a."),
    ] = ()
    method: Annotated[
        Literal["iv", "ls"],
        Option(metavar="HOW", help="iv, instruments from the rudder; ls, least squares, for comparison only."),
    ] = "iv"
    lowpass_hz: Annotated[
        float | None,
        Option(metavar="F", help="Low-pass filter, which must pass roll. Default: as needed."),
    ] = None
    scale: Annotated[
        float | None,
        Option(metavar="S", over=0.0, help="Ship length by model length, for results of the ship too."),
    ] = None
    out: OutByData = None


class Incline(Request):
    """Say what inclining tests tell: heel, and the accuracy of metacentric height and roll inertia.

    Writes incline.json, with a row for every weight and shift.

    Example: expdesign incline --vessel ship.toml --mass-kg 0.2 0.4 --shift-m 0.05 0.1
    """

    vessel: Annotated[Path, Option(metavar="VESSEL.toml", help="Ship with [roll].")]
    mass_kg: Annotated[tuple[float, ...], Option(metavar="M ...", help="Weights on board that may be shifted.")]
    shift_m: Annotated[tuple[float, ...], Option(metavar="Y ...", help="Shifts across the ship.")]
    heel_std_deg: Annotated[float, Option(metavar="S", help="Standard deviation of one reading of heel.")] = 0.02
    period_std_s: Annotated[
        float | None,
        Option(metavar="S", help="Standard deviation of a decay's period. Default: no decay."),
    ] = None
    shifts: Annotated[int, Option(metavar="N", min=1, help="Shifts that are read.")] = 4
    read_s: Annotated[
        float,
        Option(
            metavar="T",
            min=0.0,
            help="Time over which a reading of heel is averaged; acts in [roll.waves].",
        ),
    ] = 60.0
    out: OutInclined = None
