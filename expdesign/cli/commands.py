"""The subcommands: each hands its arguments to the workflow of the same name.

The solvers behind the workflows take seconds to load; each command loads them when it runs, so that `--help` and
typing mistakes do not wait.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from expdesign import __version__
from expdesign.cli.arguments import check_out, parse_seed
from expdesign.cli.progress import shown_progress
from expdesign.cli.summary import as_json, print_summary

if TYPE_CHECKING:
    from expdesign.workflows import Outcome, Progress

app = typer.Typer(
    add_completion=False,
    rich_markup_mode="rich",
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog="Exit status: 0 done; 2 the input is wrong; 3 the input is fine but has no answer; 130 interrupted.",
)

ScenarioFile = Annotated[
    Path,
    typer.Argument(metavar="SCENARIO.toml", help="Vessel, manoeuvres, sea area, start, goal and wishes."),
]
PlanFile = Annotated[
    Path,
    typer.Argument(metavar="PLAN.json", help="A plan made before, with the track.csv and commands.csv beside it."),
]
Out = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; runs/<name of the scenario> when not given."),
]
OutBeside = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; the plan's folder when not given."),
]
Seed = Annotated[
    int,
    typer.Option("--seed", parser=parse_seed, metavar="N", help="Start of the random numbers: same seed, same result."),
]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="Print no progress and no summary, only errors.")]
Json = Annotated[bool, typer.Option("--json", help="Print the summary as JSON, and nothing else, on stdout.")]


def _show_version(asked: bool) -> None:
    if asked:
        typer.echo(f"expdesign {__version__}")
        raise typer.Exit


@app.callback()
def expdesign(
    version: Annotated[
        bool, typer.Option("--version", is_eager=True, callback=_show_version, help="Print the version and stop.")
    ] = False,
) -> None:
    """Plan a trial that tells most about how a ship moves, in the water it may use.

    [bold]run[/bold] makes everything from one scenario file: what each manoeuvre tells,
    how long to run each, one trajectory from start to goal, verified by
    simulating it again, route files and a report. The other commands are its
    steps, one at a time.

    Begin with: expdesign run scenarios/helsinki.toml
    """


@app.command()
def run(scenario: ScenarioFile, out: Out = None, seed: Seed = 0, quiet: Quiet = False, json: Json = False) -> None:
    """Do everything: score, durations, plan, verify, export, report.

    Example: expdesign run scenarios/helsinki.toml
    """
    from expdesign import workflows

    _carry_out("run", lambda tell: workflows.run(scenario, check_out(out), seed=seed, progress=tell), quiet, json)


@app.command()
def score(scenario: ScenarioFile, out: Out = None, seed: Seed = 0, quiet: Quiet = False, json: Json = False) -> None:
    """Simulate the dictionary of manoeuvres and compute what each one tells.

    Writes dictionary.json.
    """
    from expdesign import workflows

    _carry_out("score", lambda tell: workflows.score(scenario, check_out(out), seed=seed, progress=tell), quiet, json)


@app.command()
def durations(
    scenario: ScenarioFile,
    out: Out = None,
    grow: Annotated[
        bool,
        typer.Option("--grow", help="Search for manoeuvres that add most, also where the scenario has no design.grow."),
    ] = False,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Choose how long to run each manoeuvre, and prove how close to the best that is.

    Writes durations.json; with --grow also growth.json and dictionary-grown.toml, which any scenario can name.
    """
    from expdesign import workflows

    _carry_out(
        "durations",
        lambda tell: workflows.durations(scenario, check_out(out), grow=grow, seed=seed, progress=tell),
        quiet,
        json,
    )


@app.command()
def plan(
    scenario: ScenarioFile,
    out: Out = None,
    durations: Annotated[
        Path | None,
        typer.Option("--durations", metavar="FILE", help="A durations.json made before; computed when not given."),
    ] = None,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Join the chosen manoeuvres into one trajectory in the sea area, and verify it.

    Writes plan.json, track.csv and commands.csv.
    """
    from expdesign import workflows

    _carry_out(
        "plan",
        lambda tell: workflows.plan(scenario, check_out(out), durations=durations, seed=seed, progress=tell),
        quiet,
        json,
    )


@app.command()
def export(
    plan: PlanFile,
    formats: Annotated[
        list[str],
        typer.Option(
            "--format",
            "-f",
            metavar="F ...",
            help="One or more of: rtz rtz-1.0 rtz-1.1 gpx kml geojson qgc ardupilot csv.",
        ),
    ],
    departure: Annotated[
        str | None,
        typer.Option("--departure", metavar="TIME", help="Time of the first waypoint, e.g. 2026-05-01T08:00:00Z."),
    ] = None,
    tolerance: Annotated[
        float | None,
        typer.Option(
            "--tolerance-m",
            metavar="D",
            help="How far legs may cut corners; a third of the clearance when not given, half the beam at most.",
        ),
    ] = None,
    out: OutBeside = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Write a plan as route files for chart systems and autopilots.

    Example: expdesign export runs/helsinki/plan.json --format rtz gpx
    """
    from expdesign import workflows

    _carry_out(
        "export",
        lambda tell: workflows.export(
            plan,
            check_out(out),
            formats=tuple(formats),
            departure=departure,
            tolerance_m=tolerance,
            progress=tell,
        ),
        quiet,
        json,
    )


@app.command()
def simulate(
    plan: PlanFile,
    truth: Annotated[
        Path, typer.Option("--truth", metavar="VESSEL.toml", help="The vessel that runs the trial, with its sensors.")
    ],
    until: Annotated[
        float | None,
        typer.Option("--until", metavar="S", help="End the data after S seconds, as of a trial broken off."),
    ] = None,
    out: OutBeside = None,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Rehearse the trial: run the plan on another vessel and measure with noise.

    Writes measured.csv.
    """
    from expdesign import workflows

    _carry_out(
        "simulate",
        lambda tell: workflows.simulate(plan, check_out(out), truth=truth, until_s=until, seed=seed, progress=tell),
        quiet,
        json,
    )


@app.command()
def estimate(
    data: Annotated[
        list[Path], typer.Argument(metavar="DATA.csv ...", help="Measured runs; what is read is told in the README.")
    ],
    vessel: Annotated[
        Path, typer.Option("--vessel", metavar="VESSEL.toml", help="Model structure, start values and sensors.")
    ],
    methods: Annotated[
        list[str] | None,
        typer.Option(
            "--method",
            metavar="M ...",
            help="One or more of: ls ls-air ls-augmented ls-wind iv iv-air iv-augmented iv-wind oe oe-air. When not "
            "given: ls and iv, and those with wind where wind is measured and the model has terms for it.",
        ),
    ] = None,
    fixed: Annotated[
        list[str] | None,
        typer.Option("--fixed", metavar="NAME ...", help="Parameters kept at the vessel file's values."),
    ] = None,
    tests: Annotated[
        list[Path] | None,
        typer.Option("--test", metavar="FILE ...", help="Runs kept apart: simulated, but not used to estimate."),
    ] = None,
    velocity: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="Where u, v, r come from: measured; difference or smoothed from the pose; auto: measured where they "
            "stand, else differences.",
        ),
    ] = "auto",
    mean: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="Mean taken off the instruments, against constant disturbances: complete, batch or none. Where an "
            "input never changes only none lets its effect be seen.",
        ),
    ] = "complete",
    start: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="First instruments simulated with: nominal, the vessel file's values; ls, least squares; auto: "
            "nominal, unless they are all zero or fail.",
        ),
    ] = "auto",
    motion: Annotated[
        str,
        typer.Option(
            metavar="WHAT",
            help="What the parameters describe: continuous, the motion between samples too, as plans are made from; "
            "euler, Euler's map at the sample time.",
        ),
    ] = "continuous",
    horizon: Annotated[
        float | None,
        typer.Option(
            metavar="SECONDS",
            help="How far output error simulates before it starts anew from the data; whole runs when not given. For "
            "ships unstable on their course and for weather that is not measured.",
        ),
    ] = None,
    constant: Annotated[
        bool, typer.Option("--constant", help="Give every run a constant force of its own in output error.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; runs/<first data file> when not given."),
    ] = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate the model's parameters from measured data, with standard errors.

    Writes estimate.json, vessel-estimated.toml and estimate.html.

    Example: expdesign estimate zigzag.csv circle.csv --vessel ship.toml --method ls iv --test other.csv
    """
    from expdesign import workflows

    _carry_out(
        "estimate",
        lambda tell: workflows.estimate(
            tuple(data),
            check_out(out),
            vessel=vessel,
            methods=tuple(methods or ()),
            fixed=tuple(fixed or ()),
            velocity=velocity,
            mean=mean,
            start=start,
            motion=motion,
            horizon_s=horizon,
            constant=constant,
            tests=tuple(tests or ()),
            progress=tell,
        ),
        quiet,
        json,
    )


@app.command()
def diagnose(
    data: Annotated[
        list[Path], typer.Argument(metavar="DATA.csv ...", help="Measured runs; what is read is told in the README.")
    ],
    vessel: Annotated[
        Path,
        typer.Option(
            "--vessel", metavar="VESSEL.toml", help="The simulation model in use; parameter_std says how sure."
        ),
    ],
    scenario: Annotated[
        Path | None,
        typer.Option(
            "--scenario",
            metavar="SCENARIO.toml",
            help="Whose dictionary to search for manoeuvres that tell causes apart; standard ones when not given.",
        ),
    ] = None,
    velocity: Annotated[
        str,
        typer.Option(
            metavar="HOW",
            help="Where u, v, r come from: measured; difference or smoothed from the pose; auto: measured where they "
            "stand, else differences.",
        ),
    ] = "auto",
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; runs/<first data file> when not given."),
    ] = None,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Show what the simulation gets wrong, name the cause, extend the model.

    Writes diagnosis.json, diagnosis.html and vessel-extended.toml.

    Example: expdesign diagnose zigzag.csv circle.csv --vessel ship.toml
    """
    from expdesign import workflows

    _carry_out(
        "diagnose",
        lambda tell: workflows.diagnose(
            tuple(data),
            check_out(out),
            vessel=vessel,
            scenario=scenario,
            velocity=velocity,
            seed=seed,
            progress=tell,
        ),
        quiet,
        json,
    )


@app.command()
def replan(
    scenario: ScenarioFile,
    data: Annotated[
        list[Path],
        typer.Option(
            "--data", metavar="DATA.csv ...", help="Measured so far; the last row of the last file is the ship's place."
        ),
    ],
    vessel: Annotated[
        Path | None,
        typer.Option(
            "--vessel",
            metavar="VESSEL.toml",
            help="Model to go on with, e.g. vessel-extended.toml; estimated from the data when not given.",
        ),
    ] = None,
    remaining: Annotated[
        float | None,
        typer.Option(
            "--remaining",
            metavar="S",
            help="Informative time that is left; design.total_s less the time of the data when not given.",
        ),
    ] = None,
    interest: Annotated[
        list[str] | None,
        typer.Option(
            "--interest",
            metavar="NAME ...",
            help="Parameters that the rest is to be best for (criterion D_s), e.g. one that a diagnosis added.",
        ),
    ] = None,
    out: Out = None,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Plan the rest of a trial, from where the ship is now and with what the data so far have told.

    Writes what run writes, for the rest; and replan.json, what is known and what the rest buys, and vessel-used.toml,
    the model it is planned with. The ship is taken to be stopped at the last position of the data.

    Example: expdesign replan scenarios/story.toml --data measured.csv --vessel vessel-extended.toml --remaining 480
    """
    from expdesign import workflows

    _carry_out(
        "replan",
        lambda tell: workflows.replan(
            scenario,
            check_out(out),
            data=tuple(data),
            vessel=vessel,
            remaining_s=remaining,
            interest=tuple(interest or ()),
            seed=seed,
            progress=tell,
        ),
        quiet,
        json,
    )


@app.command()
def indices(
    vessel: Annotated[
        Path, typer.Option("--vessel", metavar="VESSEL.toml", help="Model, length and actuators of the ship.")
    ],
    data: Annotated[
        list[Path] | None, typer.Argument(metavar="[DATA.csv ...]", help="Measured zig-zags, turning circles, stops.")
    ] = None,
    speed: Annotated[
        float | None,
        typer.Option(
            "--speed-mps", metavar="V", help="Approach speed of the simulated trials; 85 % power when not given."
        ),
    ] = None,
    scale: Annotated[
        float, typer.Option("--scale", metavar="S", help="Ship length by model length, for trials of a model.")
    ] = 1.0,
    antenna: Annotated[
        float,
        typer.Option("--antenna-forward-m", metavar="X", help="How far forward of amidships the positions are."),
    ] = 0.0,
    depth: Annotated[
        float | None, typer.Option("--depth-m", metavar="D", help="Depth of the water in the measured trials.")
    ] = None,
    wind: Annotated[
        float | None, typer.Option("--wind-mps", metavar="W", help="Mean true wind in the measured trials.")
    ] = None,
    sea: Annotated[
        int | None, typer.Option("--sea-state", metavar="N", help="Sea state in the measured trials, 0 to 9.")
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; runs/<vessel>-indices when not given."),
    ] = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Turning, zig-zag and stopping indices beside their IMO limits, simulated and measured.

    Writes indices.json and indices.html.

    Example: expdesign indices zigzag.csv circle.csv --vessel ship.toml
    """
    from expdesign import workflows

    _carry_out(
        "indices",
        lambda tell: workflows.indices(
            tuple(data or ()),
            check_out(out),
            vessel=vessel,
            speed_mps=speed,
            scale=scale,
            antenna_forward_m=antenna,
            depth_m=depth,
            wind_mps=wind,
            sea_state=sea,
            progress=tell,
        ),
        quiet,
        json,
    )


@app.command()
def mine(
    data: Annotated[
        list[Path], typer.Argument(metavar="DATA.csv ...", help="Measured runs; what is read is told in the README.")
    ],
    vessel: Annotated[
        Path, typer.Option("--vessel", metavar="VESSEL.toml", help="Nominal model; its simulation gives instruments.")
    ],
    keep: Annotated[int, typer.Option("--keep", metavar="K", help="How many batches to choose.")],
    piece: Annotated[
        float | None,
        typer.Option("--piece", metavar="SECONDS", help="Cut runs into pieces of about this length first."),
    ] = None,
    fixed: Annotated[
        list[str] | None, typer.Option("--fixed", metavar="NAME ...", help="Parameters that count as known.")
    ] = None,
    mean: Annotated[
        str, typer.Option(metavar="HOW", help="Mean taken off the instruments, as in `estimate`.")
    ] = "complete",
    velocity: Annotated[str, typer.Option(metavar="HOW", help="Where u, v, r come from, as in `estimate`.")] = "auto",
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; runs/<first data file> when not given."),
    ] = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Rank recorded runs by what they tell, and choose the few to estimate from again.

    Writes mining.json and chosen.csv, which `estimate` reads.

    Example: expdesign mine voyage.csv --vessel ship.toml --piece 120 --keep 10
    """
    from expdesign import workflows

    _carry_out(
        "mine",
        lambda tell: workflows.mine(
            tuple(data),
            check_out(out),
            vessel=vessel,
            keep=keep,
            piece_s=piece,
            fixed=tuple(fixed or ()),
            mean=mean,
            velocity=velocity,
            progress=tell,
        ),
        quiet,
        json,
    )


@app.command("check-route")
def check_route(
    files: Annotated[list[Path], typer.Argument(metavar="ROUTE.rtz ...", help="RTZ or GPX files of any origin.")],
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Check route files beyond what their schemas can: ids, names, order of schedules, ranges, size."""
    from expdesign import workflows

    _carry_out("check-route", lambda tell: workflows.check_routes(tuple(files)), quiet, json)


@app.command()
def validate(
    scenario: ScenarioFile,
    truth: Annotated[
        Path | None,
        typer.Option(
            "--truth", metavar="VESSEL.toml", help="The ship that sails; the scenario's own vessel when not given."
        ),
    ] = None,
    trials: Annotated[int, typer.Option("--trials", metavar="N", help="Simulated trials of each design.")] = 100,
    method: Annotated[str, typer.Option("--method", metavar="M", help="Estimator, as in `estimate`.")] = "iv",
    integrator: Annotated[
        str,
        typer.Option(
            "--integrator",
            metavar="HOW",
            help="How the ship moves between samples: rk4, or euler, the map that discrete parameters are defined by.",
        ),
    ] = "rk4",
    jobs: Annotated[int, typer.Option("--jobs", metavar="N", help="Processes; 0 for one per core.")] = 0,
    out: Out = None,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Try the design in simulated trials: predicted against found accuracy, beside equal shares and random runs.

    Writes validation.json and validation.html. An interrupted call goes on where it stopped.
    """
    from expdesign import workflows

    _carry_out(
        "validate",
        lambda tell: workflows.validate_design(
            scenario,
            check_out(out),
            truth=truth,
            trials=trials,
            method=method,
            integrator=integrator,
            jobs=jobs,
            seed=seed,
            progress=tell,
        ),
        quiet,
        json,
    )


@app.command()
def whatif(
    scenario: ScenarioFile,
    variants: Annotated[
        list[Path],
        typer.Argument(metavar="VARIANT.toml ...", help="Files with only what differs, or complete scenarios."),
    ],
    plan: Annotated[
        bool, typer.Option("--plan", help="Plan the trials, too, so that repositioning counts; takes minutes each.")
    ] = False,
    jobs: Annotated[int, typer.Option("--jobs", metavar="N", help="Processes; 0 for one per core.")] = 0,
    scheduler: Annotated[
        str | None,
        typer.Option(
            "--scheduler", metavar="ADDRESS", help="Dask scheduler whose workers do it, e.g. tcp://host:8786."
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; runs/<scenario>-whatif when not given."),
    ] = None,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Compare variants of a scenario side by side: what changes, and what it costs.

    Writes whatif.json and whatif.html.

    Example: expdesign whatif scenarios/helsinki.toml scenarios/variants/half-an-hour.toml
    """
    from expdesign import workflows

    _carry_out(
        "whatif",
        lambda tell: workflows.whatif(
            scenario,
            tuple(variants),
            check_out(out),
            with_plan=plan,
            jobs=jobs,
            scheduler=scheduler,
            seed=seed,
            progress=tell,
        ),
        quiet,
        json,
    )


def _carry_out(name: str, work: Callable[[Progress], Outcome], quiet: bool, json: bool) -> None:
    """Do the work of one command and say what came of it."""
    with shown_progress(quiet=quiet) as progress:
        outcome = work(progress)
    if json:
        typer.echo(as_json(name, outcome))
    elif not quiet:
        print_summary(outcome)
