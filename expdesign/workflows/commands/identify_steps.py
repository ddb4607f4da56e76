"""`expdesign identify-steps`: a model of speed and yaw rate, and a nominal vessel, from steps of both commands."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from expdesign import requests
from expdesign.errors import InputError
from expdesign.export.files import vessel_toml
from expdesign.export.folder import Content
from expdesign.export.step_trial_content import StepTrialContent, Validated, step_model_json
from expdesign.export.step_trial_page import step_trial_document
from expdesign.progress import Progress, silent, within
from expdesign.records import load_records
from expdesign.requests import repeating
from expdesign.signals import Record, fit_percent
from expdesign.step_trials import Sailed, StepTrial, ahead_only, controls_of, nominal_vessel, sailed, with_delays
from expdesign.step_trials import identify_steps as identified
from expdesign.vessel import Vessel
from expdesign.workflows.outcome import Outcome, finished, results_folder, workflow
from expdesign.workflows.steps.measured import data_files, equipped
from expdesign.workflows.steps.step_list import listed_steps

SIMULATED_STEP_S = 0.5  # least time between samples of a simulation that is compared with data [s]


@workflow
def identify_steps(request: requests.IdentifySteps, *, progress: Progress = silent) -> Outcome:
    """Model and nominal vessel from steps, into `out` or runs/<first data file>.

    Raises:
        InputError: arguments or files that are wrong.
        NoAnswer: the data are no step trial, or tell too little.
    """
    for path in request.tests:
        if path in request.data:
            raise InputError(f"{path} is given to identify and to test, expected only one of them")
    folder = results_folder(request, request.data[0].stem)
    progress("reading the data", 0.0)
    ship, told = (None, ()) if request.vessel is None else equipped(request.vessel, request.data)
    record = _record(request.data, ship, request.velocity)
    names = record.batches[0].input_names
    controls = controls_of(names, request.throttle, request.rudder)
    listed = None if request.steps is None else listed_steps(request.steps, names, controls, ship)
    apart = _record(request.tests, ship, request.velocity).batches if request.tests else ()
    progress("finding steady states and fitting responses", 0.1)
    trial = identified(record, controls, seed=request.seed, progress=within(progress, 0.1, 0.7))
    content = StepTrialContent(
        trial=trial,
        listed=listed,
        before=ship,
        nominal=None if ship is None else _nominal(ship, trial, names),
        own=tuple(_validated(trial, batch) for batch in trial.batches),
        tests=tuple(_validated(trial, _turned(sailed(batch, controls), trial)) for batch in apart),
        notes=(*told, *record.notes),
        command=repeating(request),
    )
    progress("drawing the page", 0.9)
    document = step_trial_document(content)
    files: dict[str, Content] = {
        "step-model.json": step_model_json(content),
    }
    if content.nominal is not None:
        files["vessel-steps.toml"] = vessel_toml(content.nominal, comments=_comments(content))
    return finished(request, folder, files, document, progress, page="step-trial.html")


def _record(data: Sequence[Path], ship: Vessel | None, velocity: str) -> Record:
    """The record as measured: lags and dead times that a vessel file states are not undone, as they are to be found."""
    return load_records(
        list(data_files(data)),
        vessel_inputs=None if ship is None else ship.model.inputs,
        velocity=velocity,
        heading_std_rad=None if ship is None else ship.sensors.heading_rad or None,
        outputs=("u", "r"),
        actuators=() if ship is None else ship.model.actuators,
    )


def _nominal(ship: Vessel, trial: StepTrial, names: Sequence[str]) -> Vessel:
    found = nominal_vessel(ship, trial.samples, trial.delays, names)
    return replace(with_delays(found, trial.controls, trial.delays), name=f"{ship.name}-steps")


def _turned(batch: Sailed, trial: StepTrial) -> Sailed:
    return replace(batch, commands=batch.commands * [1.0, trial.rudder_sign])


def _validated(trial: StepTrial, batch: Sailed) -> Validated:
    batch = ahead_only(batch, trial.ahead)
    every = max(1, round(SIMULATED_STEP_S / batch.sample_time_s))
    states, step_s = batch.state[::every], every * batch.sample_time_s
    simulated = trial.model.simulated(states, batch.commands[::every], sample_time_s=step_s)
    return Validated(
        name=batch.name,
        time_s=batch.time_s[::every],
        measured=states,
        simulated=simulated,
        fit_percent=fit_percent(states, simulated),
    )


def _comments(content: StepTrialContent) -> tuple[str, ...]:
    return (
        "Nominal vessel after a step trial: parameters, standard deviations and correlations from what was known",
        'before and from the steps. Design on with [design] prior = "parameter_std", refine with expdesign estimate.',
        content.command,
    )
