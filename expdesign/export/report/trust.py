"""The chain from the mathematical optimum to the file on the bridge: what is lost, and what is proved, at each link."""

from __future__ import annotations

from dataclasses import dataclass

from expdesign.export import words
from expdesign.export.report.content import ReportContent
from expdesign.export.routes import DEGREE_DECIMALS


@dataclass(frozen=True, kw_only=True)
class Link:
    """One step: what it is, what was found, and what the number rests on."""

    step: str
    found: str
    proof: str


def chain(content: ReportContent, *, short_of_optimum: str) -> list[Link]:
    """From durations to route."""
    design, plan, check = content.design, content.plan, content.plan.verification
    links = [
        Link(
            step="Best sharing of the time",
            found=f"no other sharing among these manoeuvres is better by more than {short_of_optimum}",
            proof="equivalence theorem, computed from the matrices in dictionary.json",
        ),
        Link(
            step="Whole runs",
            found=f"{words.percent(design.efficiency_repeats)} of that optimum",
            proof="the information of the runs as they are counted",
        ),
    ]
    if plan.design_efficiency_placed is not None:
        links.append(
            Link(
                step="Runs as placed",
                found=f"{words.percent(plan.design_efficiency_placed)} of the optimum's information",
                proof="the information of the runs alone, on their headings in the wind and from the entries reached",
            )
        )
    if plan.design_efficiency_realised is not None:
        links.append(
            Link(
                step="One stitched track",
                found=f"{words.percent(plan.design_efficiency_realised)} of the optimum's information",
                proof="the information of the track as sailed, repositioning included",
            )
        )
    links.append(
        Link(
            step="Allowed water",
            found=(
                f"{words.distance(check.clearance_min_m)} at the nearest, "
                f"{words.distance(content.clearance_m)} asked for"
            ),
            proof="commands simulated again ten times finer, the hull swept against the chart's polygons",
        )
    )
    return [*links, *_route_links(content)]


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
                f"{len(route.waypoints)} waypoints; track within {words.number(fit.largest_m)} m of the legs, "
                f"{words.number(route.xtd_m)} m stated as cross-track distance{water}"
            ),
            proof=(
                f"measured at every sample, positions at {DEGREE_DECIMALS} decimals; rhumb lines stray from the "
                f"straight legs by {_small(fit.loxodrome_m)}, great circles by {_small(fit.orthodrome_m)}"
            ),
        )
    ]


def _small(length_m: float) -> str:
    return "less than 1 mm" if length_m < 1e-3 else f"{1000 * length_m:.0f} mm"
