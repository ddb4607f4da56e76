"""`expdesign validate`: designs tested in simulated trials with a true ship."""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np

from expdesign import __version__, requests
from expdesign.errors import InputError
from expdesign.estimation.methods import method_named, steady_current_method
from expdesign.export.folder import Content, write_files
from expdesign.export.validation_page import judgements, validation_document, validation_json
from expdesign.information import estimated_parameters
from expdesign.memory import digest
from expdesign.progress import Progress, silent, within
from expdesign.rehearsal import RANDOM, Rehearsal, equal_runs, validate
from expdesign.scenario import Scenario, load_vessel
from expdesign.values import Array
from expdesign.workflows.outcome import Outcome, finished, results_folder, shared, workflow
from expdesign.workflows.steps.case import loaded
from expdesign.workflows.steps.design_problem import designed
from expdesign.workflows.steps.scored import ready

OPTIMISED, EQUAL = "optimised", "equal shares"


@workflow
def validate_design(request: requests.Validate, *, progress: Progress = silent) -> Outcome:
    """The optimised design beside equal shares and random runs, in trials of a true ship or of the scenario's own.

    Without a method it is that of the designs' accuracies: iv, or with a steady current where the forecast leaves one
    unknown. An interrupted call goes on where it stopped: finished chunks of trials are kept in the folder until all
    are done.
    """
    case = loaded(request, progress)
    method = _method(case, request.method)
    method_named(method)  # refused before the dictionary is scored
    ship = case.vessel if request.truth is None else load_vessel(request.truth)
    if case.vessel.model.roll is not None:
        raise InputError(
            f"vessel {case.vessel.name!r} has a roll mode, [model.roll], which {method} does not estimate; "
            "expected it in the vessel of --truth only"
        )
    information, _ = ready(case, seed=request.seed, progress=within(progress, 0.0, 0.05))
    design = designed(case, information, seed=request.seed)
    primitives = tuple(item.primitive for item in information)
    rehearsal = Rehearsal(
        truth=ship,
        nominal=case.vessel,
        primitives=primitives,
        designs={OPTIMISED: design.repeats, EQUAL: equal_runs(primitives, case.design.total_s), RANDOM: None},
        total_s=case.design.total_s,
        environment=case.environment,
        parameters=estimated_parameters(case.vessel.model, case.design.fixed_parameters),
        method=method,
        mean_subtraction=case.design.mean_subtraction,
        excitation=case.design.excitation,
        integrator=request.integrator,
        trials=request.trials,
        seed=request.seed,
    )
    folder = results_folder(request, case.name)
    done, keep, forget = _chunk_store(folder / f".validation-{digest(__version__, rehearsal)}")
    with shared(request, load=None):
        results = validate(rehearsal, done=done, keep=keep, progress=within(progress, 0.05, 0.95))
    noisy = [
        item.primitive.name
        for item, count in zip(information, design.repeats, strict=True)
        if count and not item.excitation_condition
    ]
    judged = judgements(rehearsal, results, noisy_moduli=noisy)
    files: dict[str, Content] = {
        "validation.json": validation_json(rehearsal, results, scenario=case.name, judged=judged),
    }
    document = validation_document(rehearsal, results, scenario=case.name, judged=judged)
    outcome = finished(request.but(method=method), folder, files, document, progress, page="validation.html")
    forget()
    return outcome


def _method(case: Scenario, stated: str | None) -> str:
    """The estimator that is stated, or the one whose accuracy designs count."""
    if case.design.excitation != "free":
        usual = "iv-air" if case.vessel.model.reads_air else "iv"
    else:
        usual = steady_current_method(case.vessel.model) if case.environment.current_std_mps > 0 else "iv"
    return stated or usual


def _chunk_store(folder: Path) -> tuple[dict[str, Array], Callable[[str, Array], None], Callable[[], None]]:
    """Chunks that an earlier call left, how to keep one more, and how to forget them all."""
    done = {path.stem.replace("+", "/"): np.load(path) for path in sorted(folder.glob("*.npy"))}

    def keep(key: str, rows: Array) -> None:
        content = io.BytesIO()
        np.save(content, rows)
        write_files(folder, {f"{key.replace('/', '+')}.npy": content.getvalue()})

    return done, keep, lambda: shutil.rmtree(folder, ignore_errors=True)
