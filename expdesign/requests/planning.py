"""Commands that design and plan a trial, and compare or export the results."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

from expdesign.requests.options import (
    MOST_TRIALS,
    Argument,
    Jobs,
    NoCache,
    Option,
    OtherVessel,
    Out,
    OutBesidePlan,
    OutByCard,
    OutWhatIf,
    PlanFile,
    Request,
    ScenarioFile,
    Scheduler,
    Seed,
    StatedSeed,
)


class New(Request):
    """Make a folder to start from: scenario, vessel, dictionary and area of a kind of ship, or of the ship of a card.

    With a card the vessel file is that of expdesign nominal, candidates and bay are scaled to her length and speed, and
    the plan counts how well the card says that each parameter is known.

    Example: expdesign new mytrial --kind twin-screw
    Example: expdesign new mytrial --card card.toml
    """

    folder: Annotated[Path, Argument(metavar="NAME", help="The folder to make; also the scenario's name.")]
    kind: Annotated[
        Literal["azimuth", "propeller-rudder", "twin-screw", "asv", "model-ship"] | None,
        Option(
            metavar="K",
            help="The kind of ship: azimuth, propeller-rudder, twin-screw, asv or model-ship; that of the card's "
            "thrusters, or azimuth, when not given.",
        ),
    ] = None
    card: Annotated[
        Path | None,
        Option(metavar="CARD.toml", help="Particulars and trial values of the ship; see expdesign explain card."),
    ] = None


class Run(Request):
    """Do everything: score, durations, plan, verification, route files, report.

    Example: expdesign run mytrial/scenario.toml
    """

    scenario: ScenarioFile
    vessel: OtherVessel = None
    draft: Annotated[
        bool,
        Option(
            help="Only a quick look: one placing of the runs, checked with the nominal ship; fewer manoeuvres "
            "searched for, no drawn trials, no bounds, no route files. Marked DRAFT; goes to runs/<name of the "
            "scenario>-draft.",
        ),
    ] = False
    out: Out = None
    jobs: Jobs = 0
    scheduler: Scheduler = None
    no_cache: NoCache = False
    seed: StatedSeed = 0


class Nominal(Request):
    """Make a vessel file from a ship's particulars and what her pilot card states of trials.

    Writes vessel.toml, with standard deviations and correlations; nominal.json and nominal.html: her trials predicted
    with 95 % intervals beside what the card states, the source of every number, and what on the card contradicts.

    Example: expdesign nominal card.toml
    """

    card: Annotated[
        Path,
        Argument(metavar="CARD.toml", help="Particulars and trial values; see expdesign explain card."),
    ]
    out: OutByCard = None
    seed: Seed = 0


class Score(Request):
    """Simulate the manoeuvres of the dictionary, and rank them by the information that each adds beside all others.

    Writes dictionary.json.
    """

    scenario: ScenarioFile
    vessel: OtherVessel = None
    out: Out = None
    seed: Seed = 0


class Durations(Request):
    """Choose how long to run each manoeuvre, with a certificate of how close to the optimum that is.

    Writes durations.json; with --grow also growth.json and dictionary-grown.toml, which any scenario can name;
    with --monte-carlo also covariances.json.
    """

    scenario: ScenarioFile
    vessel: OtherVessel = None
    out: Out = None
    grow: Annotated[
        bool,
        Option(help="Also search for manoeuvres to add, as the table [design.grow] does."),
    ] = False
    monte_carlo: Annotated[
        int,
        Option(
            metavar="N",
            min=0,
            max=MOST_TRIALS,
            help="Share out time by covariances of estimates, bias counted, from N simulated trials of each manoeuvre "
            "alone, instead of by information. Only manoeuvres that inform about every parameter on their own count.",
        ),
    ] = 0
    jobs: Jobs = 0
    seed: Seed = 0


class Plan(Request):
    """Plan one trajectory that runs the chosen manoeuvres in allowed water, and verify it.

    Writes plan.json, track.csv and commands.csv.
    """

    scenario: ScenarioFile
    vessel: OtherVessel = None
    out: Out = None
    durations: Annotated[
        Path | None,
        Option(metavar="FILE", help="A durations.json made before. Default: computed now."),
    ] = None
    jobs: Jobs = 0
    scheduler: Scheduler = None
    no_cache: NoCache = False
    seed: StatedSeed = 0


class Export(Request):
    """Write a plan as route files for chart systems and autopilots: one leg for each run, and those between them.

    Example: expdesign export runs/helsinki/plan.json --format rtz gpx
    """

    plan: PlanFile
    formats: Annotated[
        tuple[str, ...],
        Option(
            "--format",
            "-f",
            metavar="F ...",
            help="One or more of: rtz rtz-1.0 rtz-1.1 gpx kml geojson qgc ardupilot csv; see "
            "expdesign explain formats.",
        ),
    ]
    departure: Annotated[
        str | None,
        Option(metavar="TIME", help="Time of the first waypoint, e.g. 2026-05-01T08:00:00Z."),
    ] = None
    tolerance_m: Annotated[
        float | None,
        Option(
            metavar="D",
            help="With --fine, which it implies: the largest distance between track and legs [m]. Default: a third of "
            "the clearance, at most half the beam.",
        ),
    ] = None
    name: Annotated[
        str | None,
        Option(metavar="NAME", help="Of the route and its files; an ECDIS lists it. Default: route."),
    ] = None
    fine: Annotated[bool, Option(help="Follow the track in every turn, instead of one leg for each run.")] = False
    out: OutBesidePlan = None


class CheckRoute(Request):
    """Check RTZ and GPX files beyond their schemas: ids, names, order of schedules, ranges, size."""

    files: Annotated[tuple[Path, ...], Argument(metavar="ROUTE.rtz ...", help="RTZ or GPX files of any origin.")]


class WhatIf(Request):
    """Compare variants of a scenario side by side: time, accuracy and cost.

    Writes whatif.json and whatif.html.

    Example: expdesign whatif mytrial/scenario.toml mytrial/half-an-hour.toml
    """

    scenario: ScenarioFile
    variants: Annotated[
        tuple[Path, ...],
        Argument(metavar="VARIANT.toml ...", help="Scenario files, complete or with only the keys that differ."),
    ]
    with_plan: Annotated[
        bool, Option("--plan", help="Also plan the trials, to compare repositioning; takes minutes each.")
    ] = False
    jobs: Jobs = 0
    scheduler: Scheduler = None
    no_cache: NoCache = False
    out: OutWhatIf = None
    seed: StatedSeed = 0


class RollPlan(Request):
    """Choose known loads, and manoeuvres at each, that tell most about roll and an unknown load.

    The vessel file has a table of roll, whose uncertain parameters are sought. Writes roll-plan.html and
    roll-plan.json, loads.toml for expdesign roll, and durations-N.json of each load case for expdesign plan. Ends with
    status 3 where no candidate tells a combination of the parameters, and names it.

    Example: expdesign roll-plan mytrial/scenario.toml --loads loads.toml
    """

    scenario: ScenarioFile
    loads: Annotated[
        Path,
        Option(metavar="LOADS.toml", help="Candidate load cases; see expdesign explain loads."),
    ]
    most_loads: Annotated[
        int | None,
        Option(metavar="N", min=1, help="At most N. Default: the fewest with nearly all information."),
    ] = None
    interest: Annotated[
        tuple[str, ...],
        Option(metavar="NAME ...", help="Parameters to determine best, e.g. m z_m. Default: all."),
    ] = ()
    place: Annotated[
        bool,
        Option(help="Also plan each load case on the chart, with routes and run cards."),
    ] = False
    minutes: Annotated[
        float,
        Option(
            metavar="M",
            over=0.0,
            help="By the clock, after which it gives up with status 3 and writes nothing.",
        ),
    ] = 30.0
    out: Out = None
    jobs: Jobs = 0
    no_cache: NoCache = False
    seed: Seed = 0
