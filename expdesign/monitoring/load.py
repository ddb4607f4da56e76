"""Port calls: the ship may carry another load afterwards, which is estimated anew and raises no alarm.

A load is a change of inertia and hull that lasts until the next call. The filter of the unmeasured force estimates it
too, so that it is in no score of a change; that of a change which looks like a load grows only as the load is known.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from expdesign.monitoring.calibration import Calibration
from expdesign.monitoring.state import Call, Load, State
from expdesign.monitoring.tuning import TUNING
from expdesign.values import Array

MOST_CALLS = 100
"""Kept for the page."""


def called(state: State, calibration: Calibration, until_s: float) -> State:
    """The state after a port call that ends then: the load may be another."""
    loads, first = calibration.loads, len(state.known.mean) - len(calibration.loads)
    more, taken = np.zeros(len(state.known.mean)), np.zeros(len(state.shift))
    more[first:] = calibration.load[loads] ** 2
    taken[loads] = -state.known.mean[first:]
    load = Load(since_s=until_s, stay_s=until_s - state.until_s, judged=0, rounds=0, taken=taken)
    known = replace(state.known, covariance=state.known.covariance + np.diag(more))
    return replace(state, known=known, load=load, calls=calls_of(state, calibration))


def with_load(state: State, calibration: Calibration) -> State:
    """Move a load that is known into the ship's model, as large effects are not linear."""
    load, loads = state.load, calibration.loads
    due = TUNING.load_settled[load.rounds] if load.rounds < len(TUNING.load_settled) else math.inf
    if not load.stay_s or load.judged < due:
        return state
    found, _ = load_of(state, calibration)
    more, load = found - load.taken, replace(load, rounds=load.rounds + 1)
    if np.abs(more).max() < TUNING.refined:
        return replace(state, load=load)
    mean = state.known.mean.copy()
    mean[len(mean) - len(loads) :] = 0.0
    known = replace(state.known, mean=mean)
    return replace(state, known=known, shift=state.shift + more, load=replace(load, taken=found))


def load_of(state: State, calibration: Calibration) -> tuple[Array, Array]:
    """(m,) what the last port call changed of the load, in sizes, and (m,) its standard error."""
    loads, first = calibration.loads, len(state.known.mean) - len(calibration.loads)
    found, std = state.load.taken.copy(), np.zeros(len(state.shift))
    found[loads] += state.known.mean[first:]
    own = calibration.inflation[loads] * np.diag(state.known.covariance)[first:]
    std[loads] = np.sqrt(own + calibration.baseline_std[loads] ** 2)
    return found, std


def calls_of(state: State, calibration: Calibration) -> tuple[Call, ...]:
    """The port calls so far, with what they changed."""
    if not state.load.stay_s:
        return state.calls
    value, std = load_of(state, calibration)
    last = Call(time_s=state.load.since_s, stay_s=state.load.stay_s, value=value, std=std)
    return (*state.calls, last)[-MOST_CALLS:]
