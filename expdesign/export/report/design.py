"""The design in a report: criterion, certificate, added manoeuvres, losses on the way, and accuracy of parameters."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from expdesign.durations import CRITERIA, DurationDesign, Efficiencies, limits_kept
from expdesign.estimation.methods import steady_current_method
from expdesign.export import words
from expdesign.export.files import Known, PlannedAccuracy, Purchase
from expdesign.export.report.content import ReportContent
from expdesign.export.report.tables import setting
from expdesign.export.routes import DEGREE_DECIMALS
from expdesign.export.words import NOTICED
from expdesign.growing import GrowRound, Growth
from expdesign.sea_area import LocalFrame
from expdesign.shortest_day import ShortestDay


def parameter_rows(content: ReportContent, found: PlannedAccuracy) -> list[tuple[str, ...]]:
    """By parameter: name, term, value, standard deviation before, after the runs, after the track, and their ratio."""
    model = content.vessel.model
    nominal = dict(zip(found.parameters, found.nominal.tolist(), strict=True))
    left = "T d{}/dt" if model.form == "discrete" else "d{}/dt"
    terms = {term.name: f"{left.format(term.equation)} = ... + {term.name} * {term.expression}" for term in model.terms}
    columns = zip(content.parameters, found.before.tolist(), found.runs.tolist(), found.track.tolist(), strict=True)
    return [
        (
            name,
            terms[name],
            _small(nominal[name], 3),
            _small(before) if before > 0 else "not stated",
            _std(runs),
            _std(track),
            f"{words.significant(before / track, 2)} times" if before > 0 and track > 0 else "",
        )
        for name, before, runs, track in columns
    ]


def _std(value: float) -> str:
    return "not estimable" if np.isnan(value) else _small(value)


def accuracy_table(day: ShortestDay) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """How well each parameter and outcome is told by every day planned, the shortest first: header and rows."""
    days = sorted((item for item in enumerate(day.tried, start=1) if item[1].told), key=lambda item: item[1].day_s)
    names = list(dict.fromkeys(name for _, item in days for name in item.told))
    header = ("", *(f"Day {number}, {words.duration(item.day_s)}" for number, item in days))
    return header, [(name, *(_small(item.told[name]) for _, item in days)) for name in names]


SMALL = 1e-3


def _small(value: float, digits: int = 2) -> str:
    """Significant digits; small values as a power of ten."""
    if not 0 < abs(value) < SMALL:
        return words.significant(value, digits)
    number, _, power = f"{value:.{digits - 1}e}".partition("e")
    trimmed = (number.rstrip("0").rstrip(".") if digits > 2 else number).replace("-", words.MINUS)
    return f"{trimmed}\N{MIDDLE DOT}10{str(int(power)).translate(RAISED)}"


RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


def equation_sentence(content: ReportContent) -> str:
    """Units and the sample time of the equations."""
    model = content.vessel.model
    units = "Parameters and standard deviations are in m, s and rad, and the model's units of force."
    if model.form == "discrete":
        return f"T is the sample time of the model, {model.sample_time_s:g} s. {units}"
    return units


def unknown_current_sentence(content: ReportContent) -> str:
    """Which estimate the accuracies are of where the forecast leaves a steady current unknown; "" where it does not."""
    std_mps = content.environment.current_std_mps
    if std_mps <= 0:
        return ""
    method = steady_current_method(content.vessel.model)
    return (
        f"The forecast leaves a steady current of {words.speed(std_mps)} (standard deviation) unknown. Accuracies on "
        f"this page hold where it is estimated with the parameters, by expdesign estimate --method {method}. By a "
        "method that knows nothing of it, errors can be many times larger."
    )


def measures_velocity(content: ReportContent) -> bool:
    """Whether the vessel file states noise to propagate."""
    sensors = content.vessel.sensors
    return sensors.velocity_mps > 0 or sensors.yaw_rate_radps > 0


def known_rows(known: Known) -> list[tuple[str, ...]]:
    """By parameter: name, what told most, value before the trial and now, standard deviations before, now, after."""
    columns = (known.before, known.now, known.stated, known.so_far, known.after)
    rows = zip(known.parameters, *(column.tolist() for column in columns), known.purchases, strict=True)
    return [
        (
            f"{name} (new)" if name in known.new else name,
            f"{item.runs} \N{MULTIPLICATION SIGN} {item.primitive}" if item.primitive else "no single manoeuvre",
            "not in the model" if math.isnan(before) else words.significant(before),
            words.significant(now, 4),
            words.significant(stated, 2) if stated > 0 else "not stated",
            _std_progress(so_far),
            _std_progress(after),
            _without(item),
        )
        for name, before, now, stated, so_far, after, item in rows
    ]


def _std_progress(value: float) -> str:
    return "not estimable" if math.isnan(value) else words.significant(value, 2)


def _without(item: Purchase) -> str:
    if not item.primitive:
        return ""
    return "not estimable" if math.isinf(item.without) else f"{words.significant(item.without, 2)} times larger"


def known_sentences(known: Known, frame: LocalFrame) -> list[str]:
    """The state of the trial."""
    lat, lon = frame.to_degrees(known.pose[:2]).tolist()
    files = ", ".join(known.data)
    left = _time_left(known)
    current = words.current(known.environment.current_to, known.environment.current_std_mps)
    wind = words.wind(known.environment.wind_to, known.environment.wind_std_mps)
    moving = f"The speed over ground was {words.speed(known.speed_mps)}. " + (
        "The plan assumes that the ship then stops relative to the water."
        if known.under_way is None
        else "The plan begins there and then, with the motion and the commands of the last rows of the data."
    )
    return [
        f"This plan is for the rest of a trial. Data so far: {words.duration(known.sailed_s)} ({files}). Informative "
        f"time left: {left}.",
        f"The data end with the ship at {words.latitude(lat)}, {words.longitude(lon)}, heading "
        f"{words.bearing(float(known.pose[2]))}. {moving}",
        f"Model: {known.model}. Weather: {current}; {wind} ({known.weather}).",
        *known.notes,
        _gain(known),
    ]


def _time_left(known: Known) -> str:
    if math.isnan(known.remaining_s):
        return "as long as the day asked for takes"
    left, whole = words.duration(known.remaining_s), words.duration(known.total_s)
    if known.remaining_stated:
        return f"{left}, as stated"
    return f"{left}, that is {whole} for the whole trial minus the duration of the data"


def _gain(known: Known) -> str:
    """The gain in accuracy by the rest of the trial."""
    both = np.isfinite(known.so_far) & np.isfinite(known.after) & (known.after > 0)
    if not both.any():
        return "The accuracy from the data so far cannot be compared with the accuracy after the rest."
    ratio = float(np.exp(np.mean(np.log(known.so_far[both] / known.after[both]))))
    first = np.isnan(known.so_far) & np.isfinite(known.after)
    names = [name for name, untold in zip(known.parameters, first, strict=True) if untold]
    more = f" The data so far cannot determine {', '.join(names)}; the rest can." if names else ""
    grown = known.after > known.so_far * (1.0 + NOTICED)
    larger = [name for name, is_so in zip(known.parameters, grown, strict=True) if is_so]
    worse = f" Larger {'is that' if len(larger) == 1 else 'are those'} of {', '.join(larger)}." if larger else ""
    factor = max(ratio, 1 / ratio)
    size = f"{words.significant(factor, 3)} times {'smaller' if ratio > 1 else 'larger'} than"
    change = "as large as" if factor < 1.0 + NOTICED else size
    return (
        f"After the rest, the expected standard deviations are {change} from the data so far (geometric mean)."
        f"{worse * (ratio > 1)}{more}"
    )


NAMES = {"continuous": "optimal allocation", "repeats": "whole runs", "uniform": "equal time"}


def comparison(compared: Sequence[Efficiencies]) -> tuple[tuple[str, ...], list[tuple[str, ...]]]:
    """Header and rows: every design under every criterion that is known."""
    known = [item for item in compared if item.of]
    designs = tuple(known[0].of) if known else ()
    header = ("Efficiency by criterion", "It minimises the", *(NAMES.get(name, name) for name in designs))
    return header, [(item.criterion, item.title, *(words.percent(item.of[name]) for name in designs)) for item in known]


def limit_rows(content: ReportContent) -> list[tuple[str, str, str, str, str]]:
    """Name, required value, optimal allocation, whole runs and price of every limit."""
    return [
        (
            kept.name,
            words.significant(kept.limit),
            words.significant(kept.continuous),
            words.significant(kept.repeats),
            words.significant(kept.price, 2) if kept.price > 1e-6 else "0",
        )
        for kept in limits_kept(content.design)
    ]


def criterion_sentence(content: ReportContent) -> str:
    """The criterion, its scope, and its models."""
    problem = content.design.problem
    title = {item.name: item.title for item in CRITERIA}[problem.aim.criterion]
    about = f", of {', '.join(problem.aim.interest)}" if problem.aim.interest else ""
    if problem.aim.criterion == "V":
        about = f": {', '.join(problem.aim.outcomes)}"
    models = {
        "nominal": "",
        "average": f", on average over {len(problem.sampled)} models drawn from the prior",
        "worst": f", for the worst of {len(problem.sampled)} models drawn from the prior",
    }[problem.robust]
    prior = " Prior knowledge is included." if problem.prior.any() else ""
    return f"Criterion {problem.aim.criterion} minimises the {title}{about}{models}.{prior}"


def equal_time_sentence(design: DurationDesign) -> str:
    """What equal time on every primitive reaches; more than the optimum only where the limits rule it out."""
    reached = words.percent(design.efficiency_uniform)
    if design.efficiency_uniform > 1.0:
        return f"Equal time for every manoeuvre is not allowed by the limits of the scenario; it would reach {reached}."
    return f"Equal time for every manoeuvre would reach {reached}."


def certificate(content: ReportContent) -> str:
    """The equivalence theorem, with this design's numbers."""
    design = content.design
    proof, net = design.certificate, design.sensitivities - design.certificate.prices
    if not math.isfinite(proof.bound):
        return f"There is no certificate of optimality: {proof.kind.removeprefix('none: ')}."
    best = int(net.argmax())
    price = " minus the price of the limits" if proof.multipliers else ""
    named = content.shown(design.problem.names[best])
    return (
        f"The durations are optimal if no sensitivity{price} exceeds the bound {words.significant(proof.level, 4)}, "
        f"and every used manoeuvre reaches it ({proof.kind}). The largest value is "
        f"{words.significant(float(net[best]), 4)}, that of {named}. So no other durations of these manoeuvres are "
        f"better by more than {short_of_optimum(content)} in {design.problem.aim.criterion}-efficiency."
    )


def short_of_optimum(content: ReportContent) -> str:
    """Upper bound on the possible gain in efficiency, rounded up."""
    design = content.design
    degree = len(content.parameters) if design.problem.aim.criterion == "D" else design.certificate.degree
    gain = math.expm1(max(design.gap, 0.0) / degree)
    if not math.isfinite(gain):
        return "not certified"
    if gain < 1e-4:
        return f"0.01{words.NB}%"
    power = 10.0 ** (math.floor(math.log10(gain)) - 1)
    return f"{100 * math.ceil(gain / power) * power:.10f}".rstrip("0").rstrip(".") + f"{words.NB}%"


Link = tuple[str, str, str]
"""One step: its name, its result, and the method behind the number."""


def chain(content: ReportContent, *, short_of_optimum: str) -> list[Link]:
    """The links that lead from durations to the route, each with its proof."""
    design, plan, check, day = content.design, content.plan, content.plan.verification, content.day
    links = [
        (
            f"Optimal durations{', which state the accuracy' if day is not None and day.most_s is None else ''}",
            f"no other allocation of the time is better by more than {short_of_optimum}",
            "equivalence theorem, with the matrices in dictionary.json",
        ),
        (
            "Whole runs",
            f"{words.percent(design.efficiency_repeats)} of that optimum",
            "information of the whole runs",
        ),
        *_day_links(day),
    ]
    for step, share, proof in (
        (
            "Runs as placed",
            plan.design_efficiency_placed,
            "information of the runs alone, with their planned headings and initial velocities",
        ),
        ("Whole track", plan.design_efficiency_realised, "information of the whole track, repositioning included"),
    ):
        if share is not None:
            links.append((step, f"{words.percent(share)} of the information of the optimum", proof))
    water = (
        "Allowed water",
        f"least clearance {words.distance(check.clearance_min_m)}, {words.distance(content.clearance_m)} required",
        "independent simulation with a ten times smaller step; swept hull against the polygons of the chart",
    )
    return [*links, water, *_route_links(content)]


def _day_links(day: ShortestDay | None) -> list[Link]:
    if day is None or day.bound is None or day.bound.day_s <= 0:
        return []
    share = words.percent(day.bound.day_s / day.plan.commands.duration_s)
    return [
        (
            "The day",
            f"no day is shorter than {words.duration(day.bound.day_s)}, {share} of this one",
            "transit at the largest speed; an upper bound on the information rate of any motion within limits",
        )
    ]


def _route_links(content: ReportContent) -> list[Link]:
    route = content.route
    if route is None:
        return []
    fit = route.fit
    water = {True: ", every leg in allowed water", False: ", NOT every leg in allowed water", None: ""}[fit.in_water]
    return [
        (
            "Exported route",
            f"{len(route.waypoints)} waypoints; track within {words.number(fit.largest_m)} m of the legs; "
            f"stated cross-track distance {words.number(route.xtd_m)} m{water}",
            f"computed at every sample, positions with {DEGREE_DECIMALS} decimals; rhumb lines deviate from the "
            f"straight legs by {_length(fit.loxodrome_m)}, great circles by {_length(fit.orthodrome_m)}",
        )
    ]


def _length(length_m: float) -> str:
    return "less than 1 mm" if length_m < 1e-3 else f"{1000 * length_m:.0f} mm"


def growth_rows(growth: Growth, shown: Callable[[str], str]) -> list[tuple[str, ...]]:
    """Additions in order: step, name, description, excitation condition, sensitivity before, gain, efficiency."""
    return [_row(number, found, shown) for number, found in enumerate(growth.rounds, start=1)]


def _row(number: int, found: GrowRound, shown: Callable[[str], str]) -> tuple[str, ...]:
    settings = ", ".join(setting(name, value) for name, value in found.settings.items())
    return (
        str(number),
        shown(found.name),
        words.family(found.family) + (f"; {settings}" if settings else ""),
        "holds" if found.excitation_condition else "does not hold",
        words.number(found.sensitivity),
        f"+{words.number(found.log_det_gain, 3)}" if found.log_det_gain >= 0 else words.number(found.log_det_gain),
        words.percent(found.efficiency),
    )


def growth_sentences(growth: Growth) -> tuple[str, str]:
    """Sentences before and after the table: the search space, and the guarantee."""
    (u, v, r) = growth.limits.tolist()
    turning = [words.number(float(np.degrees(rate)), 1) for rate in r]
    before = (
        f"The search evaluated {words.counted(growth.evaluated, 'candidate')}, with u from {words.number(u[0])} to "
        f"{words.number(u[1])} m/s, v from {words.number(v[0])} to {words.number(v[1])} m/s and r from {turning[0]} to "
        f"{turning[1]} \N{DEGREE SIGN}/s. A manoeuvre improves the design if its sensitivity exceeds "
        f"{growth.dimension}. Each step adds the most sensitive one and optimises the durations again."
    )
    after = (
        f"The most sensitive remaining candidate has {words.number(growth.best_left)}. The final design therefore has "
        f"an efficiency of at least {words.percent(growth.efficiency_left)} among all evaluated candidates. There is "
        "no guarantee about manoeuvres that were not evaluated."
    )
    return before, after
