"""Commands that design and plan a trial, and compare or export the results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from expdesign.cli.app import command
from expdesign.cli.options import (
    MOST_TRIALS,
    Jobs,
    NoCache,
    OtherVessel,
    Out,
    OutBesidePlan,
    OutByCard,
    OutWhatIf,
    PlanFile,
    ScenarioFile,
    Scheduler,
    Seed,
)


@command("new")
def new(
    folder: Annotated[Path, typer.Argument(metavar="NAME", help="The folder to make; also the scenario's name.")],
    kind: Annotated[
        str,
        typer.Option("--kind", metavar="K", help="The kind of ship: azimuth, propeller-rudder, twin-screw or asv."),
    ] = "azimuth",
) -> None:
    """Make a folder to start from: scenario, vessel, dictionary and area of a kind of ship.

    Example: expdesign new mytrial --kind twin-screw
    """


@command("run")
def run(
    scenario: ScenarioFile,
    vessel: OtherVessel = None,
    draft: Annotated[
        bool,
        typer.Option(
            "--draft",
            help="Only a quick look: one placing of the runs, checked with the nominal ship; fewer manoeuvres "
            "searched for, no drawn trials, no bounds, no route files. Marked DRAFT; goes to runs/<name of the "
            "scenario>-draft.",
        ),
    ] = False,
    out: Out = None,
    jobs: Jobs = 0,
    scheduler: Scheduler = None,
    no_cache: NoCache = False,
    seed: Seed = 0,
) -> None:
    """Do everything: score, durations, plan, verification, route files, report.

    Example: expdesign run mytrial/scenario.toml
    """


@command("nominal")
def nominal(
    card: Annotated[
        Path,
        typer.Argument(metavar="CARD.toml", help="Particulars and trial values; see expdesign explain card."),
    ],
    out: OutByCard = None,
    seed: Seed = 0,
) -> None:
    """Make a vessel file from a ship's particulars and what her pilot card states of trials.

    Writes vessel.toml, with standard deviations and correlations; nominal.json and nominal.html: her trials predicted
    with 95 % intervals beside what the card states, the source of every number, and what on the card contradicts.

    Example: expdesign nominal scenarios/cards/offshore-45m.toml
    """


@command("score")
def score(scenario: ScenarioFile, vessel: OtherVessel = None, out: Out = None, seed: Seed = 0) -> None:
    """Simulate the manoeuvres of the dictionary, and rank them by the information that each adds beside all others.

    Writes dictionary.json.
    """


@command("durations")
def durations(
    scenario: ScenarioFile,
    vessel: OtherVessel = None,
    out: Out = None,
    grow: Annotated[
        bool,
        typer.Option("--grow", help="Also search for manoeuvres to add, as the table [design.grow] does."),
    ] = False,
    monte_carlo: Annotated[
        int,
        typer.Option(
            "--monte-carlo",
            metavar="N",
            min=0,
            max=MOST_TRIALS,
            help="Share out time by covariances of estimates, bias counted, from N simulated trials of each manoeuvre "
            "alone, instead of by information. Only manoeuvres that inform about every parameter on their own count.",
        ),
    ] = 0,
    jobs: Jobs = 0,
    seed: Seed = 0,
) -> None:
    """Choose how long to run each manoeuvre, with a certificate of how close to the optimum that is.

    Writes durations.json; with --grow also growth.json and dictionary-grown.toml, which any scenario can name;
    with --monte-carlo also covariances.json.
    """


@command("plan")
def plan(
    scenario: ScenarioFile,
    vessel: OtherVessel = None,
    out: Out = None,
    durations: Annotated[
        Path | None,
        typer.Option("--durations", metavar="FILE", help="A durations.json made before. Default: computed now."),
    ] = None,
    jobs: Jobs = 0,
    scheduler: Scheduler = None,
    no_cache: NoCache = False,
    seed: Seed = 0,
) -> None:
    """Plan one trajectory that runs the chosen manoeuvres in allowed water, and verify it.

    Writes plan.json, track.csv and commands.csv.
    """


@command("export")
def export(
    plan: PlanFile,
    formats: Annotated[
        list[str],
        typer.Option(
            "--format",
            "-f",
            metavar="F ...",
            help="One or more of: rtz rtz-1.0 rtz-1.1 gpx kml geojson qgc ardupilot csv; see "
            "expdesign explain formats.",
        ),
    ],
    departure: Annotated[
        str | None,
        typer.Option("--departure", metavar="TIME", help="Time of the first waypoint, e.g. 2026-05-01T08:00:00Z."),
    ] = None,
    tolerance_m: Annotated[
        float | None,
        typer.Option(
            "--tolerance-m",
            metavar="D",
            help="With --fine, which it implies: the largest distance between track and legs [m]. Default: a third of "
            "the clearance, at most half the beam.",
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option("--name", metavar="NAME", help="Of the route and its files; an ECDIS lists it. Default: route."),
    ] = None,
    fine: Annotated[
        bool, typer.Option("--fine", help="Follow the track in every turn, instead of one leg for each run.")
    ] = False,
    out: OutBesidePlan = None,
) -> None:
    """Write a plan as route files for chart systems and autopilots: one leg for each run, and those between them.

    Example: expdesign export runs/helsinki/plan.json --format rtz gpx
    """


@command("check-route", "check_routes")
def check_route(
    files: Annotated[list[Path], typer.Argument(metavar="ROUTE.rtz ...", help="RTZ or GPX files of any origin.")],
) -> None:
    """Check RTZ and GPX files beyond their schemas: ids, names, order of schedules, ranges, size."""


@command("whatif")
def whatif(
    scenario: ScenarioFile,
    variants: Annotated[
        list[Path],
        typer.Argument(metavar="VARIANT.toml ...", help="Scenario files, complete or with only the keys that differ."),
    ],
    with_plan: Annotated[
        bool, typer.Option("--plan", help="Also plan the trials, to compare repositioning; takes minutes each.")
    ] = False,
    jobs: Jobs = 0,
    scheduler: Scheduler = None,
    no_cache: NoCache = False,
    out: OutWhatIf = None,
    seed: Seed = 0,
) -> None:
    """Compare variants of a scenario side by side: time, accuracy and cost.

    Writes whatif.json and whatif.html.

    Example: expdesign whatif scenarios/helsinki.toml scenarios/variants/half-an-hour.toml
    """


@command("roll-plan")
def roll_plan(
    scenario: ScenarioFile,
    loads: Annotated[
        Path,
        typer.Option("--loads", metavar="LOADS.toml", help="Candidate load cases; see expdesign explain loads."),
    ],
    most_loads: Annotated[
        int | None,
        typer.Option(
            "--most-loads", metavar="N", min=1, help="At most N. Default: the fewest with nearly all information."
        ),
    ] = None,
    interest: Annotated[
        list[str] | None,
        typer.Option("--interest", metavar="NAME ...", help="Parameters to determine best, e.g. m z_m. Default: all."),
    ] = None,
    place: Annotated[
        bool,
        typer.Option("--place", help="Also plan each load case on the chart, with routes and run cards."),
    ] = False,
    minutes: Annotated[
        float,
        typer.Option(
            "--minutes", metavar="M", help="By the clock, after which it gives up with status 3 and writes nothing."
        ),
    ] = 30.0,
    out: Out = None,
    jobs: Jobs = 0,
    no_cache: NoCache = False,
    seed: Seed = 0,
) -> None:
    """Choose known loads, and manoeuvres at each, that tell most about roll and an unknown load.

    The vessel file has a table of roll, whose uncertain parameters are sought. Writes roll-plan.html and
    roll-plan.json, loads.toml for expdesign roll, and durations-N.json of each load case for expdesign plan. Ends with
    status 3 where no candidate tells a combination of the parameters, and names it.

    Example: expdesign roll-plan scenarios/roll-trial.toml --loads scenarios/loads/roll-trial.toml
    """
