"""The criterion of the design, its certificate, and the efficiency under other criteria."""

from __future__ import annotations

import math
from dataclasses import dataclass

from expdesign.durations import CRITERIA, DurationDesign, limits_kept
from expdesign.export import words
from expdesign.export.report.content import ReportContent
from expdesign.export.report.tables import shown_names


@dataclass(frozen=True, kw_only=True)
class Comparison:
    """Efficiencies as a table; `missing` gives the reason why a criterion is not in it."""

    designs: tuple[str, ...]
    rows: tuple[tuple[str, str, tuple[str, ...]], ...]
    missing: tuple[tuple[str, str], ...]


NAMES = {"continuous": "optimal allocation", "repeats": "whole runs", "uniform": "equal time"}


def comparison(content: ReportContent) -> Comparison:
    """Every design under every criterion."""
    known = [item for item in content.compared if item.of]
    designs = tuple(known[0].of) if known else ()
    return Comparison(
        designs=tuple(NAMES.get(name, name) for name in designs),
        rows=tuple(
            (item.criterion, item.title, tuple(words.percent(item.of[name]) for name in designs)) for item in known
        ),
        missing=tuple((item.criterion, item.missing) for item in content.compared if item.missing),
    )


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
    named = shown_names(content).get(design.problem.names[best], design.problem.names[best])
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
