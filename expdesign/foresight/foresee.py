"""What a diagnosis of a planned trial would find: power, confusions and added runs, by the diagnosis's own tests."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from expdesign.diagnosis.causes import CAUSES
from expdesign.diagnosis.model import group_columns, turns_by_force
from expdesign.diagnosis.select import SELECTION_TUNING
from expdesign.dictionary import Primitive
from expdesign.foresight.added import with_added_runs
from expdesign.foresight.effects import (
    HiddenEffect,
    Size,
    default_sizes,
    described,
    disturbance_at,
    hidden_effects,
    joined,
    sizes_that_matter,
    standard_trials,
)
from expdesign.foresight.information import JointInformation, SimulatedUnits, joint_information, simulated_units
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
    share_shown,
)
from expdesign.foresight.trial import Background, TrialRun, background
from expdesign.foresight.values import WANTED_POWER, Confusion, Foreseen, Foresight
from expdesign.progress import Progress, in_phases, silent
from expdesign.simulation import Environment
from expdesign.values import Array
from expdesign.vessel import Vessel

LEAST_POWER = 0.01  # of a test, below which held-out runs are not asked, as the effect is hardly ever found


def foresee(
    vessel: Vessel,
    runs: Sequence[TrialRun],
    weather: Environment,
    *,
    offers: Sequence[Primitive] = (),
    sizes: Mapping[str, float] | None = None,
    seed: int = 0,
    progress: Progress = silent,
) -> Foresight:
    """The probability that a diagnosis of a trial would find each cause at a size that matters.

    Args:
        weather: the forecast; how it varies is in the trial.
        offers: manoeuvres whose runs may be added.
        sizes: of causes, in the unit of their effects in results, instead of those that matter.

    Raises:
        Diverged: the model cannot be simulated over the trial.
    """
    first, second, third = in_phases(progress, 5.0, 4.0, 2.0)
    first("simulating the trial and its diagnosis", 0.0)
    known = background(vessel, runs, weather, seed=seed)
    hidden = hidden_effects([test.candidate for test in known.tests], known.base, known.windows)
    hidden = tuple(sorted(hidden, key=lambda item: _place(item.cause)))
    own_sizes = sizes_of(vessel, hidden, known, weather, stated=sizes, progress=second)
    third("power of the tests", 0.0)
    joint = joint_information(known, hidden, own_sizes)
    found = _foreseen(known, hidden, own_sizes, joint, np.random.default_rng(seed))
    third("runs that may be added", 0.7)
    found, more = with_added_runs(vessel, known, joint, found, offers, weather)
    names = {item.cause.split(":")[0] for item in known.candidates}
    return Foresight(
        effects=found,
        unseen=tuple(
            (cause.name, cause.unseen or "it is in the model already") for cause in CAUSES if cause.name not in names
        ),
        duration_s=known.windows.duration_s,
        wanted_power=WANTED_POWER,
        random_current_mps=known.base.noise.current_std_mps,
        together=more,
        beyond=tuple(item for item in found if offers and item.needs_runs and item.added is None),
    )


def _place(cause: str) -> int:
    return [item.name for item in CAUSES].index(cause.split(":")[0])


def sizes_of(
    vessel: Vessel,
    hidden: Sequence[HiddenEffect],
    known: Background,
    weather: Environment,
    *,
    stated: Mapping[str, float] | None = None,
    progress: Progress = silent,
) -> tuple[tuple[Size, ...], ...]:
    """Per effect, the size of each of its directions: that matters, or is stated for its cause.

    Args:
        known: the trial that they are hidden in.
        stated: size by cause, in the unit of its effects in results.
    """
    ship, stated = known.base.ship, stated or {}
    std = {f"theta:{n}": s for n, s in zip(ship.model.names, ship.model.parameter_std.tolist(), strict=True)}
    progress("sizes that matter", 0.0)
    asked = [item for effect in hidden if effect.cause not in stated for item in effect.directions]
    trials = standard_trials(vessel, weather) if asked else None
    speed = float(np.nanmean(np.abs(known.windows.measured[..., 0]))) if trials is None else trials.speed_mps
    found = iter(
        sizes_that_matter(asked, trials, {**std, **ship.stated_std}, _defaults(vessel, known, speed), progress)
    )
    return tuple(
        tuple(
            Size(value=stated[effect.cause] / described(item, ship)[1], rule="stated")
            if effect.cause in stated
            else next(found)
            for item in effect.directions
        )
        for effect in hidden
    )


def _defaults(vessel: Vessel, known: Background, speed_mps: float) -> dict[str, float]:
    inputs = known.base.ship.model.inputs
    largest = np.abs(np.concatenate(known.windows.batch_inputs)).max(axis=0)
    usual = default_sizes(vessel.length_m, speed_mps)
    if not turns_by_force(known.base.ship.model):
        usual.pop("asymmetry")
    groups = {key.split(":", 1)[1] for item in known.candidates for key in item.free if key.startswith("deadband:")}
    return usual | {f"deadband:{group}": 0.05 * float(largest[group_columns(group, inputs)].max()) for group in groups}


def _foreseen(
    known: Background,
    hidden: Sequence[HiddenEffect],
    sizes: Sequence[tuple[Size, ...]],
    joint: JointInformation,
    rng: np.random.Generator,
) -> tuple[Foreseen, ...]:
    rivals = rivals_of(known.tests, joint.rows, joint.beside, rng)
    own_rows = [disturbance_at(known.base.linear, *pair) for pair in zip(joint.directions, joint.sizes, strict=True)]
    units = simulated_units(known.base, known.windows, known.again, own_rows)
    return tuple(
        _one(effect, own, index, joint.beside, rivals, known, units)
        for effect, own, index in zip(hidden, sizes, joint.blocks, strict=True)
    )


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
    units: SimulatedUnits,
) -> Foreseen:
    mixture = worst_mixture(A[np.ix_(index, index)])
    noncentrality = float(mixture @ A[np.ix_(index, index)] @ mixture)
    test = next(item for item in rivals.tests if item.candidate is effect.candidate)
    freedom, level = freedom_of(effect.candidate), level_of(test.multiplicity)
    known_size = all(math.isfinite(size.value) for size in sizes)
    place = int(np.argmax(np.abs(mixture)))
    name, factor, unit = described(effect.directions[place], known.base.ship)
    found = power(noncentrality, freedom, level) if known_size else np.array(math.nan)
    limit = float(scipy.special.chdtri(freedom, level))
    seldom = known_size and float(found) < LEAST_POWER
    shown = 1.0 if seldom else math.nan
    if known_size and not seldom:
        shown = share_shown(units, index, mixture, limit, np.random.default_rng(0))
    change = factor * (sizes[place].value if len(sizes) == 1 else _length(sizes, mixture))
    least = math.sqrt(needed_noncentrality(WANTED_POWER, freedom, level) / max(noncentrality, 1e-300))
    shift, drawn = mixture @ A[index], rivals.noise[:, index] @ mixture
    exact = (drawn + noncentrality) ** 2 / max(noncentrality, 1e-300)
    first, confusions = _against(effect, rivals, shift, exact, (noncentrality, freedom, level))
    return Foreseen(
        effect=effect,
        name=name if len(sizes) == 1 else effect_name(effect, known),
        change=change if known_size else math.nan,
        unit=unit,
        rule=sizes[place].rule,
        noncentrality=noncentrality if known_size else math.nan,
        freedom=freedom,
        level=level,
        power=float(found),
        found=float(found) * shown,
        named=float(found) * shown * first if known_size else math.nan,
        least_change=change * least if known_size and noncentrality > 0 else math.inf,
        confusions=confusions if known_size else (),
    )


def _length(sizes: tuple[Size, ...], mixture: Array) -> float:
    return float(np.linalg.norm([size.value * share for size, share in zip(sizes, mixture, strict=True)]))


def effect_name(effect: HiddenEffect, known: Background) -> str:
    """Name of an effect in results."""
    return joined([described(item, known.base.ship)[0] for item in effect.directions])


def _against(
    effect: HiddenEffect, rivals: Rivals, shift: Array, exact: Array, test: tuple[float, int, float]
) -> tuple[float, tuple[Confusion, ...]]:
    """Probability that the right cause, where it is significant, is first, and how it is told apart from the others.

    Args:
        effect: hidden.
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
    significant = tested >= scipy.special.chdtri(freedom, level)
    mine = np.maximum(net[:, own].max(axis=1), tested - price_of(effect.candidate))
    cosine = imitation(rivals, shift, noncentrality)
    first, confusions = np.ones(len(significant), dtype=bool), []
    for cause in dict.fromkeys(item for item in rivals.causes if item != effect.cause):
        index = [number for number, name in enumerate(rivals.causes) if name == cause]
        lead, best = mine - net[:, index].max(axis=1), float(cosine[index].max())
        first &= lead > 0.0
        apart = lead[significant] >= SELECTION_TUNING.equivalent_within
        confusions.append(
            Confusion(
                cause=cause,
                cosine=best,
                noncentrality=noncentrality * (1.0 - best**2),
                told_apart=float(apart.mean()) if len(apart) else 0.0,
            )
        )
    judged = first[significant] if significant.any() else first
    return float(judged.mean()), tuple(sorted(confusions, key=lambda item: item.told_apart))
