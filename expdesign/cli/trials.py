"""Commands around a plan: rehearsal, validation, variants, and the rest of a trial.

Each hands its arguments to the workflow of the same name.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from expdesign.cli.app import Json, Out, OutBeside, PlanFile, Quiet, ScenarioFile, Seed, app, carry_out
from expdesign.cli.arguments import check_out


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
    carry_out(
        "simulate",
        lambda workflows, tell: workflows.simulate(
            plan, check_out(out), truth=truth, until_s=until, seed=seed, progress=tell
        ),
        quiet,
        json,
    )


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
    carry_out(
        "validate",
        lambda workflows, tell: workflows.validate_design(
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
    carry_out(
        "whatif",
        lambda workflows, tell: workflows.whatif(
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
    carry_out(
        "replan",
        lambda workflows, tell: workflows.replan(
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
