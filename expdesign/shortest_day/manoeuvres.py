"""Manoeuvres besides the dictionary that shorten the day: worth more at the margin than they cost.

The cheapest runs of the present dictionary give prices: what information is worth in seconds, and what a second of
transit saved is. A manoeuvre that is worth more than its time, its leg's included, less what its own way saves, makes
the day cheaper, and is added. So where there is a way to go, manoeuvres are found that inform while they make good as
much of it as a transit would.

Source: G. B. Dantzig and P. Wolfe, Operations Research 8 (1960), 101-111, for adding columns by the prices of the rest.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import replace

import numpy as np

from expdesign.dictionary import PrimitiveSpec
from expdesign.growing import (
    Archive,
    Candidate,
    FamilySpace,
    GrowSettings,
    Measure,
    Worth,
    motion_limits,
    pool_of,
    refined,
    searched_spaces,
)
from expdesign.memory import recalled
from expdesign.plan.assembly import ship_on_legs
from expdesign.plan.values import PlanProblem
from expdesign.progress import Progress, silent
from expdesign.shortest_day.accuracy import Accuracy
from expdesign.shortest_day.cheapest import Relaxed, cheapest_shares, fullest_level
from expdesign.shortest_day.prices import FIRST_LEG_S, MOST_RUNS, Offer, first_prices, offered, straight_courses
from expdesign.shortest_day.values import DRAFT_POOL, DRAFT_SEARCHES
from expdesign.values import Array

# durations of manoeuvres that are searched for, in that of the longest run of the dictionary
ADDED_DURATIONS = (0.25, 0.5, 1.0)
GROWTH_SHARE = 0.6  # information from runs, as a share of what is needed, for which manoeuvres are searched for
GROWTH_ROUNDS = 8  # searches for manoeuvres that are worth more than they cost
GROWTH_GAIN = 0.02  # share of the cheapest runs' cost that a search must save for another to follow
GROWTH_FAMILIES = 6  # searched in each of them, the most promising; the best of each may be added
# largest surge speed of a manoeuvre that is added, in transit speeds, which leaves some thrust for sway, and at which
# few of the drawn ships are unstable
ADDED_SPEED = 0.93
USED = 0.1  # least runs of a manoeuvre found, in the cheapest runs not made whole, for it to be added


def manoeuvres_worth_adding(
    problem: PlanProblem,
    accuracy: Accuracy,
    settings: GrowSettings,
    day_s: float | None = None,
    *,
    progress: Progress = silent,
) -> tuple[PrimitiveSpec, ...]:
    """Manoeuvres that the cheapest runs for an accuracy would use, found by their worth in seconds.

    Velocities keep to the range of the dictionary, to both sides alike, and nearly reach the speed of legs, unless the
    settings limit them. They last as long as the longest run of the dictionary or a share of that, unless the settings
    say how long: what tells of one parameter alone is soon told.

    Args:
        problem: gives the dictionary, the limits on runs, and the way from start to goal. Where it asks for a draft,
            there are fewer candidates and fewer searches.
        settings: of the search; seconds worth take the place of sensitivity.
        day_s: length of a day whose runs tell as much as can be [s], instead of the accuracy.

    Raises:
        NoAnswer: no runs within the limits reach the accuracy; then there are no prices.
        InputError: no family or no range is left to search.
    """
    progress("simulating candidates", 0.0)
    offer, transit_mps = offered(problem, first_prices(problem)), ship_on_legs(problem).transit_speed_mps
    limits = _limits(problem, settings, transit_mps)
    measure, seed, searches = _measure(problem, limits), settings.seed or 0, GROWTH_ROUNDS
    if problem.settings.draft:
        settings, searches = replace(settings, pool=min(settings.pool, DRAFT_POOL)), DRAFT_SEARCHES
    spaces = _spaces(problem, settings, limits)
    archives, rng = recalled(pool_of, spaces, measure, settings.pool, seed), np.random.default_rng(seed)
    given, specs = len(offer.cost_s), list[PrimitiveSpec]()
    level = float(np.log(GROWTH_SHARE))
    if day_s is not None:
        level = fullest_level(accuracy, offer, day_s - offer.way_s)
    shares = cheapest_shares(accuracy, offer, level=level)
    for number in range(GROWTH_ROUNDS):
        worth, before_s = _worth(shares, problem, transit_mps), shares.bound_s
        which = f"{number + 1} of at most {GROWTH_ROUNDS}"
        activity = f"searching for manoeuvres that shorten the day, search {which}"
        progress(activity, (number + 0.5) / (GROWTH_ROUNDS + 1))
        archives = _refined(archives, worth, measure, rng)
        found = _better(archives, worth, settings)
        if not found:
            break
        specs += [candidate.spec for candidate in found]
        offer = _with(offer, found, problem, transit_mps)
        shares = cheapest_shares(accuracy, offer, level=level)
        if number + 1 == searches or shares.bound_s > (1 - GROWTH_GAIN) * before_s:
            break
    runs = shares.runs[given:]
    most = np.argsort(-runs, kind="stable")[: settings.rounds]
    chosen = [specs[index] for index in np.sort(most[runs[most] > USED])]
    taken = {item.name for item in problem.primitives}
    return tuple(replace(spec, name=_unused(number, spec, taken)) for number, spec in enumerate(chosen, start=1))


def _spaces(problem: PlanProblem, settings: GrowSettings, limits: Array) -> list[FamilySpace]:
    """Families of every duration."""
    longest_s = max(item.duration_s for item in problem.primitives)
    durations_s = [settings.run_s] if settings.run_s else [share * longest_s for share in ADDED_DURATIONS]
    return [
        space
        for run_s in durations_s
        for space in searched_spaces(problem.vessel, problem.primitives, replace(settings, run_s=run_s), limits)
    ]


def _limits(problem: PlanProblem, settings: GrowSettings, transit_mps: float) -> Array:
    """(3, 2) of u, v, r: of the dictionary, to both sides alike, nearly as fast as legs ahead, and what is stated."""
    limits = motion_limits(settings, problem.primitives)
    if "u_mps" not in settings.limits:
        limits[0, 1] = max(limits[0, 1], ADDED_SPEED * transit_mps)
    for row, key in ((1, "v_mps"), (2, "r_radps")):
        if key not in settings.limits:
            limits[row] = np.abs(limits[row]).max() * np.array([-1.0, 1.0])
    return limits


def _measure(problem: PlanProblem, limits: Array) -> Measure:
    durations = problem.design.problem
    return Measure(
        vessel=problem.vessel,
        names=durations.parameters,
        environment=problem.environment,
        mean_subtraction=durations.mean_subtraction,
        limits=limits,
        courses=straight_courses(problem),
    )


def _worth(shares: Relaxed, problem: PlanProblem, transit_mps: float) -> Worth:
    """Seconds that a run is worth for each second that it costs."""
    return Worth(
        gradient=shares.worth / problem.vessel.sample_time_s,
        leg_s=FIRST_LEG_S,
        saved_s_per_m=shares.worth_of_saved / transit_mps,
    )


def _refined(
    archives: Sequence[Archive], worth: Worth, measure: Measure, rng: np.random.Generator
) -> tuple[Archive, ...]:
    """The archives, the most promising of them with local steps."""
    merits = np.array([float(archive.merits(worth).max()) for archive in archives])
    chosen = np.sort(np.argsort(-merits, kind="stable")[:GROWTH_FAMILIES]).tolist()
    better = iter(refined([archives[index] for index in chosen], worth, measure, rng))
    return tuple(next(better) if index in chosen else archive for index, archive in enumerate(archives))


def _better(archives: Sequence[Archive], worth: Worth, settings: GrowSettings) -> list[Candidate]:
    """The best candidate of each family that is worth more than it costs, the best first, so many at most."""
    found = [best for archive in archives if (best := archive.best(worth)) is not None]
    better = sorted((best for best in found if best.merit > 1 + settings.tolerance), key=lambda best: -best.merit)
    return better[:GROWTH_FAMILIES]


def _with(offer: Offer, found: Sequence[Candidate], problem: PlanProblem, transit_mps: float) -> Offer:
    """More runs to choose from."""
    run_s = np.array([candidate.spec.settings["duration_s"] for candidate in found])
    samples = run_s / problem.vessel.sample_time_s
    matrices = np.array([candidate.matrix for candidate in found]) * samples[:, None, None]
    return replace(
        offer,
        matrices=np.concatenate([offer.matrices, matrices]),
        cost_s=np.r_[offer.cost_s, run_s + FIRST_LEG_S],
        saved_s=np.r_[offer.saved_s, np.array([candidate.made_good_m for candidate in found]) / transit_mps],
        fewest=np.r_[offer.fewest, np.zeros(len(found))],
        most=np.r_[offer.most, np.full(len(found), float(MOST_RUNS))],
    )


def _unused(number: int, spec: PrimitiveSpec, taken: Collection[str]) -> str:
    """A name that no primitive has."""
    name = f"added-{number}-{spec.family.replace('_', '-')}"
    while name in taken:
        name += "-again"
    return name
