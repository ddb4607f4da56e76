"""Commands that design and plan a trial.

Each hands its arguments to the workflow of the same name.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from expdesign.cli.app import Json, Out, OutBeside, PlanFile, Quiet, ScenarioFile, Seed, app, carry_out
from expdesign.cli.arguments import check_out


@app.command()
def run(scenario: ScenarioFile, out: Out = None, seed: Seed = 0, quiet: Quiet = False, json: Json = False) -> None:
    """Do everything: score, durations, plan, verify, export, report.

    Example: expdesign run scenarios/helsinki.toml
    """
    carry_out(
        "run", lambda workflows, tell: workflows.run(scenario, check_out(out), seed=seed, progress=tell), quiet, json
    )


@app.command()
def score(scenario: ScenarioFile, out: Out = None, seed: Seed = 0, quiet: Quiet = False, json: Json = False) -> None:
    """Simulate the dictionary of manoeuvres and compute what each one tells.

    Writes dictionary.json.
    """
    carry_out(
        "score",
        lambda workflows, tell: workflows.score(scenario, check_out(out), seed=seed, progress=tell),
        quiet,
        json,
    )


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
    carry_out(
        "durations",
        lambda workflows, tell: workflows.durations(scenario, check_out(out), grow=grow, seed=seed, progress=tell),
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
    carry_out(
        "plan",
        lambda workflows, tell: workflows.plan(scenario, check_out(out), durations=durations, seed=seed, progress=tell),
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
    carry_out(
        "export",
        lambda workflows, tell: workflows.export(
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


@app.command("check-route")
def check_route(
    files: Annotated[list[Path], typer.Argument(metavar="ROUTE.rtz ...", help="RTZ or GPX files of any origin.")],
    quiet: Quiet = False,
    json: Json = False,
) -> None:
    """Check route files beyond what their schemas can: ids, names, order of schedules, ranges, size."""
    carry_out("check-route", lambda workflows, tell: workflows.check_routes(tuple(files)), quiet, json)
