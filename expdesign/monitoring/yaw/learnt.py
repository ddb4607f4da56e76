"""A yaw model learnt from a reference, and whether the reference was informative enough for it, in plain words."""

from __future__ import annotations

import numpy as np

from expdesign.errors import NotInformative
from expdesign.monitoring.yaw.estimate import YawEstimate, estimate_yaw, halves_differ, simulate_yaw, start_values
from expdesign.monitoring.yaw.instruments import estimate_yaw_by_instruments
from expdesign.monitoring.yaw.model import YawData, YawModel
from expdesign.monitoring.yaw.recorded import MOMENT, SAMPLES, measures_moment, voyages
from expdesign.monitoring.yaw.ship import YawShip
from expdesign.signals import Record
from expdesign.vessel import VesselModel

STRETCHES = 2
"""In a part that is simulated in one go."""
FEWEST_PARTS = 4
EQUAL_FIT = 5.0
"""Halves are fitted alike within so much [%]."""
MAIN = 0.3
"""Weight from which a parameter is named in a direction."""


def learnt_ship(
    model: YawModel, vessel: VesselModel, record: Record, *, stretch_s: float
) -> tuple[YawShip, tuple[str, ...]]:
    """The yaw model of the reference by output error, and notes on it.

    Args:
        model: the structure.
        vessel: model of the ship, for the moment of the drives where none is measured.
        record: the reference, or its beginning.
        stretch_s: length of a stretch of the watch [s].

    Raises:
        InputError: a signal that the model needs is not measured.
        NotInformative: too few data, or the ship never turns.
    """
    length_s, finest_s = STRETCHES * stretch_s, stretch_s / SAMPLES
    data, _ = voyages(model, vessel, record, length_s=length_s, finest_s=finest_s)
    if len(data.r) < FEWEST_PARTS:
        raise NotInformative(
            f"the first piece of the reference has {len(data.r)} parts of {length_s:g} s without a gap, expected at "
            f"least {FEWEST_PARTS} to learn a yaw model from"
        )
    start = start_values(model, data)
    half = np.arange(len(data.r)) * 2 // len(data.r)
    whole = estimate_yaw(model, data, start, groups=np.zeros_like(half))
    values = {name: float(whole.of(name)[0]) for name in model.parameters}
    halves = estimate_yaw(model, data, values, groups=half)
    fine, _ = voyages(model, vessel, record, length_s=length_s, finest_s=finest_s / 2.0)
    crossed = estimate_yaw_by_instruments(model, fine, values, groups=np.zeros_like(half))
    minutes = data.r.size * data.sample_time_s / 60.0
    notes = (
        _moment_in_words(record),
        f"The yaw model {model.name}, learnt by output error from {minutes:.0f} min of the reference, simulates the "
        f"yaw rate with a fit of {whole.fit[0]:.1f} %: {_listed(whole)}.",
        _crossed_in_words(crossed),
        _determined_in_words(model, data, whole),
        halves_in_words(halves),
    )
    return YawShip(model=model, vessel=vessel, parameters=values), notes


def _moment_in_words(record: Record) -> str:
    if measures_moment(record):
        return f"The yaw moment of the drives is {MOMENT}; a wrong scale of it scales every parameter alike."
    return (
        f"No {MOMENT} is measured: the moment of the drives is what the vessel file's terms of r give, per moment of "
        "inertia, so that I_r is 1 where the file is right, and all parameters are counted in it."
    )


def _listed(found: YawEstimate) -> str:
    pairs = zip(found.model.parameters, found.parameters[0], found.std[0], strict=True)
    return ", ".join(f"{name} {value:.3g} ± {abs(100.0 * std / value):.2g} %" for name, value, std in pairs)


def _crossed_in_words(found: YawEstimate) -> str:
    if not np.isfinite(found.parameters).all():
        return "By instruments, too little is determined of it: the estimate does not settle."
    return (
        f"By instruments, which noise of the inputs does not bias if it is independent from sample to sample: "
        f"{_listed(found)}."
    )


def _determined_in_words(model: YawModel, data: YawData, found: YawEstimate) -> str:
    """Rank test: combinations of parameters that are determined better than to their own size."""
    values = found.parameters[0]
    rates, slopes = simulate_yaw(model, data, values)
    columns = (slopes * np.abs(values)).reshape(-1, len(values))
    noise = float(np.sqrt(((data.r - rates) ** 2).mean()))
    _, size, directions = np.linalg.svd(columns / max(noise, 1e-12), full_matrices=False)
    determined = size > 1.0
    if determined.all():
        return f"The reference determines all {len(values)} parameters, each combination better than to its own size."
    weak = np.abs(directions[~determined]).max(axis=0) > MAIN
    names = ", ".join(name for name, here in zip(model.parameters, weak, strict=True) if here)
    return (
        f"The reference determines {int(determined.sum())} of {len(values)} combinations of the parameters better than "
        f"to their own size; it does not determine {names}."
    )


def halves_in_words(halves: YawEstimate) -> str:
    """Whether two halves of a voyage give the same parameters: the alarm of data that are not informative enough."""
    one, other = (
        YawEstimate(model=halves.model, parameters=halves.parameters[part], std=halves.std[part], fit=halves.fit[part])
        for part in (slice(0, 1), slice(1, 2))
    )
    apart = halves_differ(one, other)[0]
    fits = f"{one.fit[0]:.1f} and {other.fit[0]:.1f} %"
    if not apart.any():
        return f"Both halves of the reference give these parameters within a factor of three, with fits of {fits}."
    names = ", ".join(name for name, here in zip(halves.model.parameters, apart, strict=True) if here)
    if abs(one.fit[0] - other.fit[0]) > EQUAL_FIT:
        return f"Halves of the reference differ in {names} by more than a factor of three, and in their fit: {fits}."
    return (
        f"Not informative enough: halves of the reference give {names} that differ by more than a factor of three or "
        f"in sign, at equal fit ({fits}). Take a longer reference, or one with more turns, for these."
    )
