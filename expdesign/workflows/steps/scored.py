"""The dictionary of a scenario, scored."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from expdesign.dictionary import PrimitiveSpec, build_dictionary
from expdesign.durations import bordered, pool_gains
from expdesign.export.document import Document, Table, tabled
from expdesign.export.files import dictionary_files, dictionary_json, growth_json
from expdesign.growing import GrowSettings, Growth, grow_dictionary
from expdesign.information import PrimitiveInformation, estimated_parameters, score_primitives
from expdesign.memory import recalled
from expdesign.progress import Progress, silent, within
from expdesign.scenario import Scenario
from expdesign.signals import Commands, Trajectory
from expdesign.vessel import Environment, Vessel, column_name

SPEED_SLACK = 0.1  # share of the largest speed of the data by which a run may go beyond them
FAR_FROM_LIMIT = 0.5  # share of an actuator's limit below which no run comes near it
IDLE = 1e-9
"""Share of an actuator's limit, or command where it has none, up to which it is not used: what rounding leaves."""


def scored(case: Scenario, *, progress: Progress = silent) -> tuple[PrimitiveInformation, ...]:
    """Information of every primitive of a scenario."""
    return recalled(
        _scored,
        case.vessel,
        case.dictionary,
        case.environment,
        case.design.fixed_parameters,
        case.design.mean_subtraction,
        case.design.excitation,
        progress=progress,
    )


def _scored(
    vessel: Vessel,
    dictionary: Sequence[PrimitiveSpec],
    environment: Environment,
    fixed_parameters: tuple[str, ...],
    mean_subtraction: str,
    excitation: str,
    *,
    progress: Progress,
) -> tuple[PrimitiveInformation, ...]:
    progress("simulating the dictionary", 0.0)
    primitives = build_dictionary(vessel, dictionary)
    progress("scoring the dictionary", 0.5)
    return score_primitives(
        vessel,
        primitives,
        environment=environment,
        fixed_parameters=fixed_parameters,
        mean_subtraction=mean_subtraction,
        excitation=excitation,
    )


def speed_remarks(vessel: Vessel, runs: Iterable[Trajectory], what: str) -> tuple[str, ...]:
    """Surge speeds beyond those of the data that determined the model; one line."""
    if vessel.model.speeds_mps is None:
        return ()
    surge = np.concatenate([run.velocity[:, 0] for run in runs])
    (low, high), (least, most) = vessel.model.speeds_mps, (float(surge.min()), float(surge.max()))
    slack = SPEED_SLACK * max(abs(low), abs(high))
    if least >= low - slack and most <= high + slack:
        return ()
    least, most = (round(speed, 3) + 0.0 for speed in (least, most))  # a ship at rest goes at 0, not at -4.7e-15
    return (
        f"a {what} goes from {least:.3g} to {most:.3g} m/s, but the data that determined the model from {low:.3g} to "
        f"{high:.3g} m/s (model.speeds_mps): what lies beyond is extrapolated",
    )


def actuation_remarks(vessel: Vessel, runs: Iterable[Commands], what: str) -> tuple[str, ...]:
    """Actuators that no run uses, and limits that none comes near; one line each."""
    peaks = np.max([np.abs(commands.values).max(axis=0) for commands in runs], axis=0)
    sizes = np.array([max(abs(limit.low), abs(limit.high)) for limit in vessel.limits])
    peaks[peaks <= IDLE * np.where(np.isfinite(sizes), sizes, 1.0)] = 0.0
    used = dict(zip(vessel.model.inputs, peaks.tolist(), strict=True))
    idle = [
        column_name(signal)
        for actuator in vessel.actuators
        if not any(used[signal] for signal in actuator.signals)
        for signal in actuator.signals
    ]
    far = [
        f"{column_name(signal)} ({used[signal] / size:.0%})"
        for signal, size in zip(vessel.model.inputs, sizes, strict=True)
        if np.isfinite(size) and 0 < used[signal] < FAR_FROM_LIMIT * size
    ]
    return (
        *([f"no {what} uses {', '.join(idle)}"] if idle else []),
        *([f"far from its limit in every {what}: {', '.join(far)}; what lies beyond is extrapolated"] if far else []),
    )


def score_files(case: Scenario, information: Sequence[PrimitiveInformation]) -> dict[str, str | bytes]:
    """`dictionary.json`."""
    text = dictionary_json(
        information, parameters_of(case), vessel=case.vessel, mean_subtraction=case.design.mean_subtraction
    )
    return {"dictionary.json": text}


def ranking(case: Scenario, information: Sequence[PrimitiveInformation]) -> Table:
    """Primitives by what they add beside all others, which also ranks those that do not inform alone."""
    gains = pool_gains(np.array([bordered(item, case.design.mean_subtraction) for item in information]))
    order = np.argsort(np.where(np.isnan(gains), np.inf, -gains), kind="stable")
    return Table(
        title="Primitives by what they add to log det beside all others, and alone",
        header=("rank", "primitive", "gain beside the pool", "log det alone"),
        rows=tuple(
            (
                str(rank),
                information[q].primitive.name,
                "-" if np.isnan(gains[q]) else f"{gains[q]:.3g}",
                "singular" if (alone := information[q].log_det_alone) is None else f"{alone:.4g}",
            )
            for rank, q in enumerate(order, start=1)
        ),
    )


def parameters_of(case: Scenario) -> tuple[str, ...]:
    """Parameters that a scenario estimates, in order."""
    return estimated_parameters(case.vessel.model, case.design.fixed_parameters)


STEM = "dictionary-grown"


def grown(
    case: Scenario,
    information: Sequence[PrimitiveInformation],
    *,
    always: bool = False,
    seed: int = 0,
    progress: Progress = silent,
) -> Growth | None:
    """The scored dictionary with additions as the scenario sets; None without [design.grow], and for a stated accuracy.

    The search for the shortest day looks for additions by itself, for what they save.

    Args:
        case: the scenario; its key design.grow says how.
        always: grow it by the usual settings also without that key.
        seed: of all chance, unless the key has its own.
    """
    for_durations = None if case.design.accuracy else case.design.grow
    settings = for_durations or ((case.design.grow or GrowSettings()) if always else None)
    if settings is None:
        return None
    return grow_dictionary(
        case.vessel,
        information,
        settings=settings if settings.seed is not None else replace(settings, seed=seed),
        environment=case.environment,
        fixed_parameters=case.design.fixed_parameters,
        mean_subtraction=case.design.mean_subtraction,
        progress=progress,
    )


def growth_files(case: Scenario, growth: Growth | None) -> dict[str, str | bytes]:
    """The grown dictionary as a file for every command, and the additions."""
    if growth is None:
        return {}
    comments = (
        f"The dictionary of scenario {case.name!r} and {len(growth.rounds)} manoeuvres added to it.",
        f"They were found for vessel {case.vessel.name!r}.",
    )
    specs = [*case.dictionary, *growth.specs]
    return {
        **dictionary_files(specs, name=f"{case.name}-grown", stem=STEM, comments=comments),
        "growth.json": growth_json(growth),
    }


def growth_notes(case: Scenario) -> tuple[str, ...]:
    """What says which settings of [design] the search for additions ignores, if any."""
    settings, limits = case.design, case.design.limits
    asked_for = {
        f"criterion {settings.criterion}": settings.criterion != "D",
        f"predictor {settings.predictor}": settings.predictor != "model",
        f"robust {settings.robust}": settings.robust != "nominal",
        "prior": settings.prior != "none" or bool(settings.prior_data),
        "times": bool(limits.least_s or limits.most_s or limits.required or limits.excluded),
        "budgets": bool(limits.budgets),
        "balance": bool(limits.balance),
        "reveal": bool(settings.reveal or settings.tell_apart),
    }
    asked = [name for name, is_asked in asked_for.items() if is_asked]
    if not asked:
        return ()
    return (
        "Manoeuvres were added for criterion D of the nominal model alone; only the durations account for "
        f"{', '.join(asked)} of [design].",
    )


def growth_document(growth: Growth | None, case: Scenario) -> Document:
    """What a document says of additions: their gains, and the settings that the search ignored."""
    if growth is None:
        return Document()
    rows = tuple(
        (
            str(number),
            row.name,
            f"{row.sensitivity:.2f}",
            f"{row.log_det_gain:+.3f}",
            f"{row.efficiency:.3f}",
            "yes" if row.excitation_condition else "no",
            " ".join(f"{key} {value:.4g}" for key, value in row.settings.items()),
        )
        for number, row in enumerate(growth.rounds, start=1)
    )
    header = ("round", "added", "d before", "log det", "D-efficiency", "excites", "settings")
    title = f"Manoeuvres added; one improves the design if its d is above {growth.dimension}"
    return Document(
        facts={
            "manoeuvres_added": len(growth.rounds),
            "efficiency_of_grown_dictionary": growth.rounds[-1].efficiency if growth.rounds else 1.0,
            "candidates_looked_at": growth.evaluated,
            "efficiency_at_least_among_candidates": growth.efficiency_left,
        },
        sections=tabled(Table(title=title, header=header, rows=rows)),
        notes=growth_notes(case),
    )


def ready(
    case: Scenario, *, grow: bool = False, seed: int, progress: Progress = silent
) -> tuple[tuple[PrimitiveInformation, ...], Growth | None]:
    """The scored dictionary, grown if the scenario or the command says so."""
    information = scored(case, progress=within(progress, 0.0, 0.2 if grow or case.design.grow else 1.0))
    growth = grown(case, information, always=grow, seed=seed, progress=within(progress, 0.2, 1.0))
    return (information if growth is None else growth.information), growth
