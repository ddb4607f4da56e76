"""What a diagnosis of a planned trial would find: power, confusions and added runs, by the diagnosis's own tests."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from expdesign.diagnosis.causes import CAUSES, Candidate
from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import Fit
from expdesign.diagnosis.model import group_columns, turns_by_force
from expdesign.diagnosis.motion import Disturbance, initial_states, stable_windows
from expdesign.diagnosis.select import (
    SELECTION_TUNING,
    ScoreTest,
    candidate_disturbances,
    fit_nuisance,
    open_candidates,
    score_tests,
)
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.foresight.effects import HiddenEffect, described, disturbance_at, hidden_effects
from expdesign.foresight.information import batch_information, beside_nuisance
from expdesign.foresight.power import (
    Rivals,
    freedom_of,
    gains,
    imitation,
    level_of,
    needed_noncentrality,
    power,
    price_of,
    rivals_of,
)
from expdesign.foresight.sizes import Size, default_sizes, sizes_that_matter, standard_trials
from expdesign.foresight.trial import TrialRun, simulated_record, weather_without_causes
from expdesign.foresight.tuning import TUNING
from expdesign.foresight.values import Confusion, Foreseen, Foresight
from expdesign.progress import Progress, in_phases, silent
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel

UNSEEN = {
    "shallow_water": "no depth is recorded",
    "actuator_deadband": "commands have too few sizes, or a dead band is stated",
    "actuator_scale": "the ship has no rudder, or the scale is stated",
    "wind": "the model has no equation that air acts in",
    "current": "no heading is measured",
    "gyro_scale": "no yaw rate is measured",
    "heading_bias": "surge and sway are not both measured",
    "lever_arm": "sway and yaw are not both measured",
    "roll_coupling": "sway and yaw are not both in the model",
    "thruster_asymmetry": "yaw is not in the model",
}
"""Cause -> why a trial's records cannot show it, where they cannot."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Background:
    """A trial with nothing hidden, as a diagnosis sees it before it looks for causes.

    Attributes:
        base: the fit of uncertain parameters and of the noise.
        windows: the data.
        candidates: of the catalogue.
        tests: of those candidates that differ from everything in the fit.
    """

    base: Fit
    windows: Windows
    candidates: tuple[Candidate, ...]
    tests: tuple[ScoreTest, ...]


def background(vessel: Vessel, runs: Sequence[TrialRun], weather: Environment, *, seed: int = 0) -> Background:
    """Simulate a trial without hidden effects, and prepare its tests.

    Args:
        vessel: the model in use, with its sensors.
        runs: of the trial.
        weather: the forecast.
        seed: of sensor noise, weather and the null distribution of the tests.
    """
    rng = np.random.default_rng(seed)
    record = simulated_record(vessel, runs, weather_without_causes(vessel, weather), rng)
    ship = extended_model(vessel, record)
    windows = stable_windows(ship, record)
    base = fit_nuisance(ship, windows, initial_states(windows))
    candidates = tuple(open_candidates(base, windows))
    tests = score_tests(base, candidates, rng)
    return Background(base=base, windows=windows, candidates=candidates, tests=tests)


def foresee(
    vessel: Vessel,
    runs: Sequence[TrialRun],
    weather: Environment,
    *,
    seed: int = 0,
    progress: Progress = silent,
) -> Foresight:
    """With which probability a diagnosis of a trial would find each cause at a size that matters.

    Args:
        vessel: the model in use, with its sensors.
        runs: of the trial.
        weather: the forecast; how it varies is in the trial.
        seed: of all chance.
        progress: of the work.

    Raises:
        Diverged: the model cannot be simulated over the trial.
    """
    first, second, third = in_phases(progress, 5.0, 4.0, 2.0)
    first("simulating the trial and its diagnosis", 0.0)
    known = background(vessel, runs, weather, seed=seed)
    hidden = hidden_effects([test.candidate for test in known.tests], known.base, known.windows)
    hidden = tuple(sorted(hidden, key=lambda item: _place(item.cause)))
    sizes = _sizes(vessel, hidden, known, weather, second)
    third("power of the tests", 0.0)
    found = _foreseen(known, hidden, sizes, np.random.default_rng(seed))
    names = {item.cause.split(":")[0] for item in known.candidates}
    return Foresight(
        effects=found,
        unseen=tuple((cause.name, UNSEEN.get(cause.name, "it is in the model already"))
                     for cause in CAUSES if cause.name not in names),
        samples=int(np.isfinite(known.windows.measured).any(axis=2).sum()),
        duration_s=known.windows.duration_s,
        wanted_power=TUNING.wanted_power,
        random_current_mps=known.base.noise.current_std_mps,
    )  # fmt: skip


def _place(cause: str) -> int:
    return [item.name for item in CAUSES].index(cause.split(":")[0])


def _sizes(
    vessel: Vessel, hidden: Sequence[HiddenEffect], known: Background, weather: Environment, progress: Progress
) -> tuple[tuple[Size, ...], ...]:
    """Per effect, the size of each of its directions."""
    ship = known.base.ship
    std = {f"theta:{n}": s for n, s in zip(ship.model.names, ship.model.parameter_std.tolist(), strict=True)}
    progress("sizes that matter", 0.0)
    trials = standard_trials(vessel, weather)
    speed = float(np.nanmean(np.abs(known.windows.measured[..., 0]))) if trials is None else trials.speed_mps
    directions = [item for effect in hidden for item in effect.directions]
    found = iter(
        sizes_that_matter(directions, trials, {**std, **ship.stated_std}, _defaults(vessel, known, speed), progress)
    )
    return tuple(tuple(next(found) for _ in effect.directions) for effect in hidden)


def _defaults(vessel: Vessel, known: Background, speed_mps: float) -> dict[str, float]:
    inputs = known.base.ship.model.inputs
    largest = np.abs(np.concatenate(known.windows.batch_inputs)).max(axis=0)
    usual = default_sizes(vessel.length_m, speed_mps)
    if not turns_by_force(known.base.ship.model):
        usual.pop("asymmetry")
    groups = {key.split(":", 1)[1] for item in known.candidates for key in item.free if key.startswith("deadband:")}
    return usual | {f"deadband:{group}": 0.05 * float(largest[group_columns(group, inputs)].max()) for group in groups}


def _foreseen(
    known: Background, hidden: Sequence[HiddenEffect], sizes: Sequence[tuple[Size, ...]], rng: np.random.Generator
) -> tuple[Foreseen, ...]:
    linear, base = known.base.linear, known.base
    disturbances = [
        disturbance_at(linear, direction, size.value if math.isfinite(size.value) else 1.0)
        for effect, own in zip(hidden, sizes, strict=True)
        for direction, size in zip(effect.directions, own, strict=True)
    ]
    rows = _candidate_rows(known, disturbances)
    whole = batch_information(linear, base.keys, disturbances, base.noise).sum(axis=0)
    A = beside_nuisance(whole, base.precision)
    rivals = rivals_of(known.tests, rows, A, rng)
    found, first = [], 0
    for effect, own in zip(hidden, sizes, strict=True):
        index = np.arange(first, first + len(own))
        first += len(own)
        found.append(_one(effect, own, index, A, rivals, known))
    return tuple(found)


def _candidate_rows(known: Background, disturbances: list[Disturbance]) -> list[Array]:
    """Per tested candidate, its rows; appends the disturbances of all of them, shared ones once."""
    shared: dict[object, int] = {}
    rows = []
    for test in known.tests:
        index = []
        for tag, disturbance in candidate_disturbances(known.base.linear, test.candidate):
            if tag not in shared:
                shared[tag] = len(disturbances)
                disturbances.append(disturbance())
            index.append(shared[tag])
        rows.append(np.array(index))
    return rows


def worst_mixture(block: Array) -> Array:
    """(d,) mixture of d effects, each at its size, of length one, that shows least; signs as the first."""
    values, vectors = np.linalg.eigh(block)
    mixture = vectors[:, int(np.argmin(values))]
    return np.asarray(mixture * (1.0 if mixture[int(np.argmax(np.abs(mixture)))] > 0 else -1.0))


def _one(
    effect: HiddenEffect,
    sizes: tuple[Size, ...],
    index: NDArray[np.int64],
    A: Array,
    rivals: Rivals,
    known: Background,
) -> Foreseen:
    mixture = worst_mixture(A[np.ix_(index, index)])
    noncentrality = float(mixture @ A[np.ix_(index, index)] @ mixture)
    test = next(item for item in rivals.tests if item.candidate is effect.candidate)
    freedom, level = freedom_of(effect.candidate), level_of(test.multiplicity)
    known_size = all(math.isfinite(size.value) for size in sizes)
    place = int(np.argmax(np.abs(mixture)))
    name, factor, unit = described(effect.directions[place], known.base.ship)
    found = power(noncentrality, freedom, level) if known_size else np.array(math.nan)
    change = factor * (sizes[place].value if len(sizes) == 1 else _length(sizes, mixture))
    least = math.sqrt(needed_noncentrality(TUNING.wanted_power, freedom, level) / max(noncentrality, 1e-300))
    shift, drawn = mixture @ A[index], rivals.noise[:, index] @ mixture
    exact = (drawn + noncentrality) ** 2 / max(noncentrality, 1e-300)
    named, confusions = _against(effect, rivals, shift, exact, (noncentrality, freedom, level))
    return Foreseen(
        effect=effect,
        name=name if len(sizes) == 1 else _joint_name(effect, known),
        change=change if known_size else math.nan,
        unit=unit,
        rule=sizes[place].rule,
        noncentrality=noncentrality if known_size else math.nan,
        freedom=freedom,
        level=level,
        power=float(found),
        named=named if known_size else math.nan,
        least_change=change * least if known_size and noncentrality > 0 else math.inf,
        confusions=confusions if known_size else (),
    )


def _length(sizes: tuple[Size, ...], mixture: Array) -> float:
    return float(np.linalg.norm([size.value * share for size, share in zip(sizes, mixture, strict=True)]))


def _joint_name(effect: HiddenEffect, known: Background) -> str:
    return " ".join(described(item, known.base.ship)[0] for item in effect.directions)


def _against(
    effect: HiddenEffect, rivals: Rivals, shift: Array, exact: Array, test: tuple[float, int, float]
) -> tuple[float, tuple[Confusion, ...]]:
    """Probability that the right cause is significant and first, and how it is told apart from the others.

    Args:
        effect: hidden.
        rivals: all candidates.
        shift: (m,) expected scores.
        exact: (n,) gain of the hidden effect itself in every draw, which a fit of a finite effect finds.
        test: noncentrality, freedom and level of its own test.
    """
    noncentrality, freedom, level = test
    gain = gains(rivals, shift)
    net = gain - np.array([price_of(item.candidate) for item in rivals.tests])
    own = [number for number, item in enumerate(rivals.tests) if item.candidate.cause == effect.cause]
    (place,) = [number for number, item in enumerate(rivals.tests) if item.candidate is effect.candidate]
    tested = exact if effect.candidate.finite else gain[:, place]
    significant = tested >= chi2.isf(level, freedom)
    mine = np.maximum(net[:, own].max(axis=1), tested - price_of(effect.candidate))
    cosine = imitation(rivals, shift, noncentrality)
    first, confusions = significant.copy(), []
    for cause in dict.fromkeys(item for item in rivals.causes if item != effect.cause):
        index = [number for number, name in enumerate(rivals.causes) if name == cause]
        lead, best = mine - net[:, index].max(axis=1), float(cosine[index].max())
        first &= lead > 0.0
        told = lead[significant] >= SELECTION_TUNING.equivalent_within
        confusions.append(
            Confusion(
                cause=cause,
                cosine=best,
                noncentrality=noncentrality * (1.0 - best**2),
                told_apart=float(told.mean()) if len(told) else 0.0,
            )
        )
    return float(first.mean()), tuple(sorted(confusions, key=lambda item: item.told_apart))
