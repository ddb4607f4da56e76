"""Commands on measured data.

Each hands its arguments to the workflow of the same name.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from expdesign.cli.app import Json, Quiet, Seed, app, carry_out
from expdesign.cli.arguments import check_out

DataFiles = Annotated[
    list[Path], typer.Argument(metavar="DATA.csv ...", help="Measured runs; what is read is told in the README.")
]
Velocity = Annotated[
    str,
    typer.Option(
        metavar="HOW",
        help="Where u, v, r come from: measured; difference or smoothed from the pose; auto: measured where they "
        "stand, else differences.",
    ),
]
OutByData = Annotated[
    Path | None,
    typer.Option("--out", "-o", metavar="FOLDER", help="Where to write; runs/<first data file> when not given."),
]


@app.command()
def estimate(
    data: DataFiles,
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
    velocity: Velocity = "auto",
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
    out: OutByData = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Estimate the model's parameters from measured data, with standard errors.

    Writes estimate.json, vessel-estimated.toml and estimate.html.

    Example: expdesign estimate zigzag.csv circle.csv --vessel ship.toml --method ls iv --test other.csv
    """
    carry_out(
        "estimate",
        lambda workflows, tell: workflows.estimate(
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
    data: DataFiles,
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
    velocity: Velocity = "auto",
    out: OutByData = None,
    seed: Seed = 0,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Show what the simulation gets wrong, name the cause, extend the model.

    Writes diagnosis.json, diagnosis.html and vessel-extended.toml.

    Example: expdesign diagnose zigzag.csv circle.csv --vessel ship.toml
    """
    carry_out(
        "diagnose",
        lambda workflows, tell: workflows.diagnose(
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
    carry_out(
        "indices",
        lambda workflows, tell: workflows.indices(
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
    data: DataFiles,
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
    velocity: Velocity = "auto",
    out: OutByData = None,
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Rank recorded runs by what they tell, and choose the few to estimate from again.

    Writes mining.json and chosen.csv, which `estimate` reads.

    Example: expdesign mine voyage.csv --vessel ship.toml --piece 120 --keep 10
    """
    carry_out(
        "mine",
        lambda workflows, tell: workflows.mine(
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
