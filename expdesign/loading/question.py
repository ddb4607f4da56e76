"""What a load trial is to find: free parameters, what is known of them, and the candidate loads."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from expdesign.errors import InputError
from expdesign.loading.information import LoadOption
from expdesign.roll import PARAMETERS, parameters
from expdesign.values import Array, seal
from expdesign.vessel import NOMINAL, Load, Vessel

# of a parameter's standard deviation, below which its value counts as zero; the deviation is then its size
SMALL_SHARE = 0.01


WEIGHED = ("m", "z_m")
"""Parameters of an unknown load."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Question:
    """What is sought, from which ship with which loads."""

    vessel: Vessel  # with a pendulum
    options: tuple[LoadOption, ...]  # candidate loads, their names once each
    free: tuple[str, ...]  # names of the parameters sought
    theta: Array  # (9,) parameters, as believed
    size: Array  # (p,) of each free parameter, positive: its value, or its standard deviation where it is about zero
    prior: Array  # (p, p) information about relative changes, change over size, before the trial

    def __post_init__(self) -> None:
        seal(self, theta="9", size="p", prior="p p")

    @property
    def places(self) -> list[int]:
        """Places of the free parameters among all."""
        return [PARAMETERS.index(name) for name in self.free]

    @property
    def generic(self) -> Array:
        """(9,) parameters, those about zero at their size, where the rank of equations is the usual one."""
        theta = np.array(self.theta)
        theta[self.places] = np.where(np.abs(theta[self.places]) < self.size, self.size, theta[self.places])
        return theta


def build_question(
    vessel: Vessel, loads: Sequence[Load | None], *, known: Mapping[str, float], guess: Mapping[str, float]
) -> Question:
    """The question of a vessel file with candidate loads.

    Args:
        vessel: its [roll] says what is known: parameters with a standard deviation are sought.
        loads: candidates; None for an unknown one.
        known: parameters that are known otherwise.
        guess: m and z_m of the unknown load, roughly.

    Raises:
        InputError: no [roll] is there, nothing is sought, the unknown load is not guessed, or one is too heavy or high.
    """
    pendulum = vessel.pendulum
    if pendulum is None:
        raise InputError(f"vessel {vessel.name!r} has no table [roll], expected a vessel file with one")
    weighed = None in loads
    for name in WEIGHED:
        if weighed and not guess.get(name):
            raise InputError(f"start.{name} is missing, expected a rough {name} of the unknown load")
    if weighed and not guess["m"] > 0:
        raise InputError(f"start.m is {guess['m']:g}, expected more than 0")
    unknown = Load(mass_kg=guess["m"], z_m=guess["z_m"]) if weighed else NOMINAL
    for load in loads:
        _check_on_board(vessel, pendulum.body.mass_kg, unknown if load is None else load)
    theta = parameters(**{**pendulum.parameters, **known, **({n: guess[n] for n in WEIGHED} if weighed else {})})
    std = {name: value for name, value in pendulum.parameter_std.items() if value > 0 and name not in known}
    free = tuple(name for name in PARAMETERS if name in std or (weighed and name in WEIGHED and name not in known))
    if not free:
        raise InputError(
            f"vessel {vessel.name!r} states no standard deviations of roll, expected [roll.parameter_std] for what the "
            "trial is to find"
        )
    at = np.abs(theta[[PARAMETERS.index(name) for name in free]])
    deviation = np.array([std.get(name, 0.0) for name in free])
    size = np.where(at > SMALL_SHARE * deviation, at, deviation)
    correlation = np.eye(len(free))
    for (one, other), value in pendulum.parameter_correlation.items():
        if one in free and other in free:
            i, j = free.index(one), free.index(other)
            correlation[i, j] = correlation[j, i] = value
    stated = np.flatnonzero(deviation)
    covariance = (correlation * np.outer(deviation / size, deviation / size))[np.ix_(stated, stated)]
    prior = np.zeros((len(free),) * 2)
    prior[np.ix_(stated, stated)] = np.linalg.inv(covariance)
    options = tuple(LoadOption(name=_name(load), load=load) for load in loads)
    names = [option.name for option in options]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise InputError(f"two candidate loads are the same, {twice}, expected each once")
    return Question(vessel=vessel, options=options, free=free, theta=theta, size=size, prior=(prior + prior.T) / 2)


def _check_on_board(vessel: Vessel, own_kg: float, load: Load) -> None:
    """Raise where a load sinks the ship or floats above her."""
    if not load.mass_kg < own_kg:
        raise InputError(f"a load has {load.mass_kg:g} kg, expected less than the ship's own {own_kg:g} kg")
    if not abs(load.z_m) <= vessel.length_m:
        raise InputError(
            f"a load of {load.mass_kg:g} kg is at height {-load.z_m:g} m, expected within the length of the ship, "
            f"{vessel.length_m:g} m, of the line of the vessel file"
        )


def _name(load: Load | None) -> str:
    if load is None:
        return "the unknown load"
    return f"{load.mass_kg:g} kg at height {-load.z_m:g} m" if load.mass_kg else "the ship alone"
