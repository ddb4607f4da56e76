"""The steps from the mathematical optimum to the route file: the loss and the proof at each step."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.export import words
from expdesign.export.report.content import ReportContent
from expdesign.export.routes import DEGREE_DECIMALS
from expdesign.shortest_day import ShortestDay


@dataclass(frozen=True, kw_only=True)
class Link:
    """One step: its name, its result, and the method behind the number."""

    step: str
    found: str
    proof: str


def chain(content: ReportContent, *, short_of_optimum: str) -> list[Link]:
    """The links that lead from durations to the route, each with its proof."""
    design, plan, check = content.design, content.plan, content.plan.verification
    links = [
        Link(
            step=f"Optimal durations{', which state the accuracy' if _asks_accuracy(content.day) else ''}",
            found=f"no other allocation of the time is better by more than {short_of_optimum}",
            proof="equivalence theorem, with the matrices in dictionary.json",
        ),
        Link(
            step="Whole runs",
            found=f"{words.percent(design.efficiency_repeats)} of that optimum",
            proof="information of the whole runs",
        ),
        *_day_links(content.day),
    ]
    if plan.design_efficiency_placed is not None:
        links.append(
            Link(
                step="Runs as placed",
                found=f"{words.percent(plan.design_efficiency_placed)} of the information of the optimum",
                proof="information of the runs alone, with their planned headings and initial velocities",
            )
        )
    if plan.design_efficiency_realised is not None:
        links.append(
            Link(
                step="Whole track",
                found=f"{words.percent(plan.design_efficiency_realised)} of the information of the optimum",
                proof="information of the whole track, repositioning included",
            )
        )
    links.append(
        Link(
            step="Allowed water",
            found=(
                f"least clearance {words.distance(check.clearance_min_m)}, "
                f"{words.distance(content.clearance_m)} required"
            ),
            proof="independent simulation with a ten times smaller step; swept hull against the polygons of the chart",
        )
    )
    return [*links, *_route_links(content)]


def _asks_accuracy(day: ShortestDay | None) -> bool:
    return day is not None and day.most_s is None


def _day_links(day: ShortestDay | None) -> list[Link]:
    if day is None or day.bound is None or day.bound.day_s <= 0:
        return []
    share = words.percent(day.bound.day_s / day.plan.commands.duration_s)
    return [
        Link(
            step="The day",
            found=f"no day is shorter than {words.duration(day.bound.day_s)}, {share} of this one",
            proof="transit at the largest speed; an upper bound on the information rate of any motion within limits",
        )
    ]


def _route_links(content: ReportContent) -> list[Link]:
    route = content.route
    if route is None:
        return []
    fit = route.fit
    water = {True: ", every leg in allowed water", False: ", NOT every leg in allowed water", None: ""}[fit.in_water]
    return [
        Link(
            step="Exported route",
            found=(
                f"{len(route.waypoints)} waypoints; track within {words.number(fit.largest_m)} m of the legs; "
                f"stated cross-track distance {words.number(route.xtd_m)} m{water}"
            ),
            proof=(
                f"computed at every sample, positions with {DEGREE_DECIMALS} decimals; rhumb lines deviate from the "
                f"straight legs by {_small(fit.loxodrome_m)}, great circles by {_small(fit.orthodrome_m)}"
            ),
        )
    ]


def _small(length_m: float) -> str:
    return "less than 1 mm" if length_m < 1e-3 else f"{1000 * length_m:.0f} mm"
