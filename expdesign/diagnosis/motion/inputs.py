"""Inputs of an extended model: actuators, water, air, depth and time."""

from __future__ import annotations

from collections.abc import Hashable
from functools import cached_property
from weakref import WeakKeyDictionary

import numpy as np
import scipy

from expdesign.diagnosis.data import Windows, averaging_half_width
from expdesign.diagnosis.model import RESPONSES, ExtendedModel, group_columns, mean_wind, response_effect
from expdesign.simulation import deliver, keeps_to, positions
from expdesign.simulation.motion import to_body
from expdesign.simulation.program import evaluation
from expdesign.values import Array
from expdesign.vessel import NUMPY, Response, generalised_force
from expdesign.vessel.quantities import ACTUATORS, acts_on
from expdesign.vessel.structures import FORCE_SIGNALS, SHOAL

# parts of an integrator step in which moving actuators are followed, at least; forces are not linear in angles
ACTUATOR_SUBSTEPS = 4
FEW_STEPS, MOST_KNOWN = 10_000, 64  # integrator steps of windows whose forces are kept, and how many of them


# Inputs as the actuators of an extended model deliver them.
#
# Slew rate, dead band, dead time, lag, offset and scale, in this order. Orders that are recorded late act before they
# are recorded.


def delivered_inputs(ship: ExtendedModel, rows: Array, windows: Windows) -> tuple[Array, int]:
    """Delivered inputs (k, m, b) of batches of equal length, and how many of their rows an integrator step has.

    Args:
        rows: (k_b, m, b) held inputs.
        windows: that they belong to.
    """
    inputs = ship.model.inputs
    rows = _slewed(ship, rows, windows)
    moving = any(key.startswith(("delay:", "lag:", "lead:")) and value for key, value in ship.effects.items())
    parts = -(-ACTUATOR_SUBSTEPS // windows.rows_per_step) if moving else 1
    delivered = np.repeat(rows, parts, axis=0)
    finer = parts * windows.rows_per_step
    for kind, field in RESPONSES.items():
        for key, value in ship.effects.items():
            if kind != "slew" and key.startswith(kind + ":") and value != 0.0:
                columns, response = group_columns(key.split(":", 1)[1], inputs), _response(field, value)
                responses = (response,) * len(columns)
                through = deliver(responses, delivered[:, columns], sample_time_s=windows.step_s / finer)
                delivered[:, columns] = through[:, 0]
    for key, value in ship.effects.items():
        if key.startswith("lead:") and value > 0.0:  # a dead time in time that runs backward
            columns = group_columns(key.split(":", 1)[1], inputs)
            orders = (_response("delay_s", value),) * len(columns)
            early = deliver(orders, delivered[::-1, columns], sample_time_s=windows.step_s / finer)
            delivered[:, columns] = early[::-1, 0]
    return delivered * _scales(ship)[:, None], finer


def _slewed(ship: ExtendedModel, rows: Array, windows: Windows) -> Array:
    """Mean positions over each sample of the data of actuators that move towards recorded commands at a slew rate."""
    held = windows.steps_per_sample if windows.rows_per_step == 1 else 1  # steps in between repeat the inputs
    sample_s = windows.step_s / windows.rows_per_step * held
    for key, value in ship.effects.items():
        if not key.startswith("slew:") or value <= 0.0:
            continue
        response = _response("rate", response_effect("slew", value))
        for column in group_columns(key.split(":", 1)[1], ship.model.inputs):
            for batch in range(rows.shape[2]):
                commands = rows[::held, [column], batch]
                if not keeps_to(_stated_rate(ship, column, response.rate), commands[:, 0], sample_time_s=sample_s):
                    given, _ = positions((response,), commands, sample_time_s=sample_s, standing=None)
                    rows = rows.copy()
                    rows[:, column, batch] = np.repeat(given[:, 0], held)[: len(rows)]
    return rows


def _stated_rate(ship: ExtendedModel, column: int, rate: float) -> float:
    """The rate that the vessel file states for an input, else another one: what is recorded is judged once."""
    stated = (
        value
        for key, value in ship.stated.items()
        if key.startswith("slew:") and column in group_columns(key.split(":", 1)[1], ship.model.inputs)
    )
    return response_effect("slew", next(stated, 1.0 / rate))


def actuator_effects(ship: ExtendedModel) -> dict[str, float]:
    """Effects that change what actuators deliver."""
    return {key: value for key, value in ship.effects.items() if value and acts_on(key, ACTUATORS)}


def _scales(ship: ExtendedModel) -> Array:
    """(m,) factors of the inputs."""
    factors = np.ones(len(ship.model.inputs))
    for key, value in ship.effects.items():
        if key.startswith("scale:"):
            factors[group_columns(key.split(":", 1)[1], ship.model.inputs)] *= 1.0 + value
    return factors


def _response(field: str, value: float) -> Response:
    """A response with one effect; fits may try times and dead bands below zero, which count as zero."""
    return Response(**{field: value if field == "offset" else max(value, 0.0)})


BEGIN, END = "begin ", "end "


class ExogenousInputs(dict[str, Array]):
    """Exogenous signals at the integrator steps (w, k): inputs and forces by name, and others.

    `u_c v_c` water and `u_w v_w` air, their velocity in the b-frame [m/s], where they move;
    `h`, draught over depth, and `after`, one after a change of the ship, where the model reads such things.
    Values are means over each step; signals that change within steps also have values at the beginning of each step and
    at its end, `begin NAME` and `end NAME`.
    """

    @cached_property
    def rising(self) -> tuple[str, ...]:
        """Names of signals that change within steps."""
        return tuple(name.removeprefix(BEGIN) for name in self if name.startswith(BEGIN))

    def __getstate__(self) -> None:
        """What is cached is not sent to other processes."""

    def at(self, step: int) -> ExogenousInputs:
        """One integrator step of every window."""
        result = ExogenousInputs({name: values[:, step] for name, values in self.items()})
        result.__dict__["rising"] = self.rising  # the same signals at every step: not looked for again
        return result

    def at_fraction(self, share: float) -> ExogenousInputs:
        """Values within the steps, from -0.5 at their beginning to 0.5 at their end."""
        if not self.rising or share == 0.0:
            return self
        result = ExogenousInputs(self)
        for name in self.rising:
            begin, end = self[f"{BEGIN}{name}"], self[f"{END}{name}"]
            at_end = begin if share == -0.5 else end
            result[name] = at_end if abs(share) == 0.5 else self[name] + share * (end - begin)
        return result

    def begun(self, steps: int) -> ExogenousInputs:
        """The first steps."""
        return ExogenousInputs({name: values[:, :steps] for name, values in self.items()})

    @cached_property
    def without_last_step(self) -> ExogenousInputs:
        """All steps but the last."""
        return self.begun(-1)


def exogenous_inputs(
    ship: ExtendedModel, windows: Windows, *, known: tuple[ExtendedModel, ExogenousInputs] | None = None
) -> ExogenousInputs:
    """The exogenous signals, with the inputs as delivered by the actuators.

    Args:
        windows: w windows.
        known: another ship and its signals over the same windows; the same actuators are not followed again.
    """
    model = ship.model
    table = _forces(ship, windows) if known is None else _forces_like(ship, windows, *known)
    north, east = ship.get("current:north"), ship.get("current:east")
    if north or east:
        table["u_c"], table["v_c"] = to_body((north, east), true_heading(ship, windows), NUMPY)
    if any(part.reads_air for part in ship.scaled_terms):
        table["u_w"], table["v_w"] = _wind(ship, windows)
    if model.reads_depth or any(key.startswith("shallow:") for key in ship.effects):
        table[SHOAL] = ship.draught_m / windows.depth_m
    if "change:time" in ship.effects:
        table["after"] = windows.share_after(ship.effects["change:time"])
    return table


_known_forces = WeakKeyDictionary[Windows, dict[Hashable, ExogenousInputs]]()


def _forces(ship: ExtendedModel, windows: Windows) -> ExogenousInputs:
    """Delivered inputs and their forces; of few data they are kept: a search returns to the same actuators often."""
    if windows.heading.size > FEW_STEPS:
        return _followed(ship, windows)
    acting = tuple(actuator_effects(ship).items())
    stated = tuple(item for item in sorted(ship.stated.items()) if item[0].startswith("slew:"))
    key = (acting, stated, ship.model.inputs, ship.model.actuators, _force_names(ship))
    known = _known_forces.setdefault(windows, {})
    if key not in known:
        if len(known) >= MOST_KNOWN:
            known.clear()
        known[key] = _followed(ship, windows)
    return ExogenousInputs(known[key])


def _followed(ship: ExtendedModel, windows: Windows) -> ExogenousInputs:
    """The same, each actuator followed; batches of equal length at once, those without windows never."""
    batches, found = windows.batch_inputs, dict[int, Array]()
    used = np.unique(windows.batch).astype(int).tolist()
    for length in dict.fromkeys(len(batches[place]) for place in used):
        places = [place for place in used if len(batches[place]) == length]
        rows, finer = delivered_inputs(ship, np.stack([batches[place] for place in places], axis=-1), windows)
        acting = _acting(ship, rows, finer, windows.rows_per_step)
        found |= {place: acting[..., at] for at, place in enumerate(places)}
    signals = windows.gather(found)
    names = _force_names(ship)
    names = (*names, *(f"{end}{name}" for end in (BEGIN, END) for name in names)) if finer > 1 else names
    return ExogenousInputs({name: signals[..., i] for i, name in enumerate(names)})


def _forces_like(
    ship: ExtendedModel, windows: Windows, other: ExtendedModel, known: ExogenousInputs
) -> ExogenousInputs:
    """Forces as of `_forces`, from the signals of another ship where its actuators deliver the same."""
    names = _force_names(ship)
    shape = known[names[0]].shape if names[0] in known else None
    if actuator_effects(ship) != actuator_effects(other) or shape != windows.heading.shape or {*names} - {*known}:
        return _forces(ship, windows)
    ends = [f"{end}{name}" for end in (BEGIN, END) for name in names]
    return ExogenousInputs({name: known[name] for name in (*names, *ends) if name in known})


def _force_names(ship: ExtendedModel) -> tuple[str, ...]:
    return (*dict.fromkeys((*ship.model.inputs, *FORCE_SIGNALS)), *ship.input_products)


def _acting(ship: ExtendedModel, rows: Array, finer: int, rows_per_step: int) -> Array:
    """(k, m, b) inputs, forces and products: means over integrator steps; where steps have parts, ends of lines, too.

    A straight line between these ends has the mean and the first moment of the signal within the step. Where
    measurements are averaged over samples, so is the signal, because the mean force drives the mean motion.
    """
    table = dict(zip(ship.model.inputs, np.moveaxis(rows, 1, 0), strict=True))
    forces = generalised_force(ship.model.actuators, table, NUMPY)
    table |= dict(zip(FORCE_SIGNALS, forces, strict=True))
    table |= dict(zip(ship.input_products, evaluation([*ship.input_products.values()]).values(table), strict=True))
    known = np.empty((len(rows), len(table), rows.shape[2]))
    for column, values in enumerate(table.values()):
        known[:, column] = values
    if finer == 1:
        return known
    parts = _averaged(known, finer, rows_per_step).reshape(len(rows) // finer, finer, *known.shape[1:])
    place = (np.arange(finer) + 0.5) / finer - 0.5
    means, half_rises = parts.mean(axis=1), 6.0 * np.einsum("f,kf...->k...", place, parts) / finer
    return np.concatenate([means, means - half_rises, means + half_rises], axis=1)


def _averaged(values: Array, finer: int, rows_per_step: int) -> Array:
    """Means over the samples around every instant."""
    half, apart = averaging_half_width(rows_per_step), finer // rows_per_step
    if not half:
        return values
    others = [(0, 0)] * (values.ndim - 1)
    held = np.pad(values, [(half * apart, half * apart), *others], mode="edge").reshape(-1, apart, *values.shape[1:])
    means = scipy.ndimage.uniform_filter1d(held, 2 * half + 1, axis=0)[half:-half]  # a running sum, of any width
    return np.asarray(means.reshape(values.shape))


def _wind(ship: ExtendedModel, windows: Windows) -> tuple[Array, Array]:
    """Measured where it is, else the mean wind of the model."""
    if windows.has_wind:
        return windows.wind[..., 0], windows.wind[..., 1]
    u_w, v_w = to_body(mean_wind(ship), true_heading(ship, windows), NUMPY)
    return u_w, v_w


def true_heading(ship: ExtendedModel, windows: Windows) -> Array:
    """(w, k) heading, corrected for the compass error where velocities come from the pose."""
    return windows.heading + ship.get("heading_bias") if "u" in ship.derived else windows.heading
