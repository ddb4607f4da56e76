"""A simulation model with effects added to it: every cause of the catalogue is a few named numbers, zero for "absent".

Effects, by key:

    theta:NAME            change of a model parameter
    term:NAME             coefficient of a library term that the model lacks
    current:north/east    steady current [m/s]
    wind:north/east       mean wind where none is measured [m/s]
    gain, gain:propeller  thrust too strong by this share; all terms of inputs, or those without a rudder
    asymmetry             yaw moment per unit of ahead force: the thrust's line of action passes this far to port [m]
    offset:GROUP          added to the angles of a group of inputs [rad]
    lag:GROUP, delay:GROUP, deadband:GROUP    of a group of inputs [s], [s], [unit of the input]
    inertia:u/v/r         inertia too small by this share
    shallow:damping, shallow:inertia          growth per unit of draught over depth
    roll:sway, roll:yaw   acceleration per rad of roll; roll:period [s] and roll:damping say which roll
    change:time           [s]; change:gain, change:damping_u/v/r, change:theta:NAME act after it
    heading_bias          [rad], lever:forward/starboard [m], gyro (share), late:u/v/r/psi/position [s]   (sensors)

A GROUP is the stem of input names ("n", "a", "rudder", "tau_x", ...), one input, or "all".
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.signal import lfilter

from expdesign.conventions import OUTPUTS
from expdesign.diagnosis.windows import Windows
from expdesign.values import Array
from expdesign.vessel import NUMPY, Term, VesselModel, generalised_force
from expdesign.vessel.expressions import Evaluate, Expression, parse_expression
from expdesign.vessel.structures import FORCE_SIGNALS, MOTION_SIGNALS

Effects = Mapping[str, float]
ANGLE_STEMS = ("a", "rudder")


@dataclass(frozen=True, kw_only=True, eq=False)
class Extended:
    """A model with effects.

    Attributes:
        model: driven by the recorded inputs.
        library: terms that the model lacks, by name.
        draught_m: of the ship [m].
        effects: key -> value; what is left out is zero.
    """

    model: VesselModel
    library: Mapping[str, Term]
    draught_m: float
    effects: Effects = field(default_factory=dict)
    parts: tuple[Part, ...] = field(init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "parts", (*_own_parts(self), *_added_parts(self)))

    def having(self, effects: Effects) -> Extended:
        """The same with some effects set to other values."""
        return replace(self, effects={**self.effects, **effects})

    def get(self, key: str) -> float:
        """Value of an effect."""
        return self.effects.get(key, 0.0)

    @property
    def has_roll(self) -> bool:
        """Roll is part of the motion."""
        return "roll:period" in self.effects

    @property
    def states(self) -> int:
        """u, v, r, and with roll its angle and rate."""
        return 5 if self.has_roll else 3


class Surroundings(dict[str, Array]):
    """What acts on the ship at the integrator steps (w, k): inputs and forces by signal name, and besides.

    `u_c v_c` water and `u_w v_w` air, their velocity in the b-frame [m/s], where they move;
    `shoal`, draught over depth, and `after`, one after a change of the ship, where the model has such effects.
    """

    def at(self, step: int) -> Surroundings:
        """One integrator step of every window."""
        return Surroundings({name: values[:, step] for name, values in self.items()})

    def before_last(self) -> Surroundings:
        """All steps but the last."""
        return Surroundings({name: values[:, :-1] for name, values in self.items()})


def surroundings(ship: Extended, windows: Windows) -> Surroundings:
    """Everything outside the ship, with the inputs as its actuators follow them."""
    model, shape = ship.model, windows.heading.shape
    names = (*dict.fromkeys((*model.inputs, *FORCE_SIGNALS)),)
    signals = windows.gather(tuple(_acting(model, *rows) for rows in followed_inputs(ship, windows)))
    table = Surroundings({n: np.broadcast_to(signals[..., i], shape) for i, n in enumerate(names)})
    if ship.get("asymmetry"):
        table["tau_psi"] = table["tau_psi"] + ship.get("asymmetry") * ahead_force(table, model)
        table["lean"] = ship.get("asymmetry") * ahead_force(table, model)
    north, east = ship.get("current:north"), ship.get("current:east")
    if north or east:
        table["u_c"], table["v_c"] = to_body(north, east, windows.heading)
    if any(part.reads_air for part in ship.parts):
        table["u_w"], table["v_w"] = _wind(ship, windows)
    if any(key.startswith("shallow:") for key in ship.effects):
        table["shoal"] = ship.draught_m / windows.depth_m
    if "change:time" in ship.effects:
        table["after"] = (windows.time_s >= ship.effects["change:time"]).astype(float)
    return table


def _acting(model: VesselModel, rows: Array, finer: int) -> Array:
    """(k, m) inputs and forces, each its mean over the finer steps that it is known at."""
    table = dict(zip(model.inputs, rows.T, strict=True))
    forces = generalised_force(model.actuators, table, NUMPY)
    table |= dict(zip(FORCE_SIGNALS, forces, strict=True))
    columns = [np.broadcast_to(np.asarray(values, dtype=float), len(rows)) for values in table.values()]
    return np.asarray(np.stack(columns, axis=-1).reshape(len(rows) // finer, finer, -1).mean(axis=1))


def _wind(ship: Extended, windows: Windows) -> tuple[Array, Array]:
    """Measured where it is, else the mean wind of the model."""
    if windows.has_wind:
        return np.nan_to_num(windows.wind[..., 0]), np.nan_to_num(windows.wind[..., 1])
    return to_body(ship.get("wind:north"), ship.get("wind:east"), windows.heading)


def members(group: str, inputs: tuple[str, ...]) -> list[int]:
    """Columns of the inputs that belong to a group."""
    return [index for index, name in enumerate(inputs) if group in ("all", name) or name.rstrip("0123456789") == group]


FINER = 4
"""Steps within an integrator step in which moving actuators are followed: forces are not linear in angles."""


def followed_inputs(ship: Extended, windows: Windows) -> tuple[tuple[Array, int], ...]:
    """Per batch, the inputs after dead band, dead time, lag and offset, and how many rows an integrator step has."""
    inputs = ship.model.inputs
    moving = any(key.startswith(("delay:", "lag:")) and value for key, value in ship.effects.items())
    finer = FINER if moving else 1
    acting = tuple(np.repeat(rows, finer, axis=0) for rows in windows.batch_inputs)
    for kind, change in (("deadband", _dead_band), ("delay", _delayed), ("lag", _lagged), ("offset", _offset)):
        for key, value in ship.effects.items():
            if key.startswith(kind + ":") and value != 0.0:
                columns = members(key.split(":", 1)[1], inputs)
                acting = tuple(_changed(rows, columns, change, value, windows.step_s / finer) for rows in acting)
    return tuple((rows, finer) for rows in acting)


def _changed(rows: Array, columns: list[int], change, value: float, step_s: float) -> Array:  # type: ignore[no-untyped-def]
    result = np.array(rows)
    result[:, columns] = change(result[:, columns], value, step_s)
    return result


def _dead_band(rows: Array, width: float, step_s: float) -> Array:
    return np.where(np.abs(rows) < width, 0.0, rows)


def _offset(rows: Array, value: float, step_s: float) -> Array:
    return rows + value


def _delayed(rows: Array, delay_s: float, step_s: float) -> Array:
    """Held inputs late by any time: the mean over each step of what then acts."""
    whole, share = divmod(max(delay_s, 0.0) / step_s, 1.0)
    index = np.arange(len(rows)) - int(whole)
    near, far = rows[np.maximum(index, 0)], rows[np.maximum(index - 1, 0)]
    return (1 - share) * near + share * far


def _lagged(rows: Array, lag_s: float, step_s: float) -> Array:
    """First-order lag, the mean over each step."""
    if lag_s <= 1e-9:
        return rows
    fade = np.exp(-step_s / lag_s)
    mean_share = lag_s / step_s * (1 - fade)
    ends = lfilter([1 - fade], [1.0, -fade], rows, axis=0, zi=fade * rows[:1])[0]
    begins = np.concatenate([rows[:1], ends[:-1]])
    return np.asarray(rows + (begins - rows) * mean_share)


def to_body(north: Array | float, east: Array | float, heading: Array) -> tuple[Array, Array]:
    """An n-frame vector in the b-frame."""
    c, s = np.cos(heading), np.sin(heading)
    return north * c + east * s, east * c - north * s


def rates(ship: Extended, state: tuple[Array, ...], around: Surroundings) -> tuple[Array, ...]:
    """d/dt of (u, v, r) or (u, v, r, roll, roll rate)."""
    u, v, r = state[:3]
    totals = _accelerations(ship, u, v, r, around)
    if not ship.has_roll:
        return tuple(totals)
    roll, roll_rate = state[3:]
    w0, damping = 2 * np.pi / ship.get("roll:period"), ship.get("roll:damping")
    side = totals[1] + u * r
    totals[1] = totals[1] + ship.get("roll:sway") * roll
    totals[2] = totals[2] + ship.get("roll:yaw") * roll
    return (*totals, roll_rate, w0**2 * (side - roll) - 2 * damping * w0 * roll_rate)


def _accelerations(ship: Extended, u: Array, v: Array, r: Array, around: Surroundings) -> list[Array]:
    """d/dt (u, v, r) without roll."""
    signals: dict[str, Array] = {**around, "u": u, "v": v, "r": r}
    if "u_c" in around:
        signals["u"], signals["v"] = u - around["u_c"], v - around["v_c"]
    if "u_w" in around:
        signals["u_q"], signals["v_q"] = u - around["u_w"], v - around["v_w"]
    totals = {name: np.zeros_like(u) for name in OUTPUTS}
    steady = dict(totals)
    for part in ship.parts:
        value = part.factor * part.evaluate(signals, NUMPY)
        if part.after:
            value = value + part.after_factor(around) * part.evaluate(signals, NUMPY)
        if part.damping and "shoal" in around:
            value = value * (1 + ship.get("shallow:damping") * around["shoal"])
        into = steady if part.coriolis else totals
        into[part.equation] = into[part.equation] + value
    if "lean" in around and not any(part.reads_turn for part in ship.parts):
        totals["r"] = totals["r"] + around["lean"]
    heavier = 1.0 if "shoal" not in around else 1 + ship.get("shallow:inertia") * around["shoal"]
    return [totals[n] / ((1 + ship.get(f"inertia:{n}")) * heavier) + steady[n] for n in OUTPUTS]


@dataclass(frozen=True, kw_only=True)
class Part:
    """One term of the extended model with everything that scales it.

    Attributes:
        equation: u, v or r.
        evaluate: its regressor.
        factor: its parameter with all factors, as an acceleration.
        after: change of the factor after the change point.
        coriolis, damping, reads_air, reads_turn: what kind of term it is.
    """

    equation: str
    evaluate: Evaluate
    factor: float
    after: float = 0.0
    coriolis: bool = False
    damping: bool = False
    reads_air: bool = False
    reads_turn: bool = False

    def after_factor(self, around: Surroundings) -> Array:
        """The change of the factor at every time."""
        return np.asarray(self.after * around["after"])


def _own_parts(ship: Extended) -> list[Part]:
    """The model's own terms."""
    get, model = ship.get, ship.model
    parts = []
    for kind, value in zip(_kinds(model), model.parameters.tolist(), strict=True):
        name, equation = kind.name, kind.equation
        whole, changed = value + get(f"theta:{name}"), get(f"change:theta:{name}")
        if kind.thrust:
            whole *= (1 + get("gain")) * (1.0 if kind.rudder else 1 + get("gain:propeller"))
            changed += whole * get("change:gain")
        elif kind.damping:
            changed += whole * (get("change:damping") + get(f"change:damping_{equation}"))
        parts.append(
            Part(
                equation=equation,
                evaluate=kind.evaluate,
                factor=whole / model.time_scale_s,
                after=changed / model.time_scale_s,
                coriolis=kind.coriolis,
                damping=kind.damping,
                reads_air=kind.air,
                reads_turn=kind.turn,
            )
        )
    return parts


def _added_parts(ship: Extended) -> list[Part]:
    """Library terms that were added."""
    known = (*MOTION_SIGNALS, *dict.fromkeys((*FORCE_SIGNALS, *ship.model.inputs)))
    parts = []
    for key, value in ship.effects.items():
        if key.startswith("term:"):
            term = ship.library[key[5:]]
            expression = _parsed(term.expression, known)
            parts.append(
                Part(
                    equation=term.equation,
                    evaluate=expression.evaluate,
                    factor=value / ship.model.time_scale_s,
                    reads_air=bool({"u_q", "v_q"} & set(expression.signals)),
                )
            )
    return parts


@lru_cache(maxsize=512)
def _parsed(text: str, known: tuple[str, ...]) -> Expression:
    return parse_expression(text, signals=known)


@dataclass(frozen=True, kw_only=True)
class Kind:
    """What kind of term it is."""

    name: str
    equation: str
    evaluate: Evaluate
    thrust: bool
    rudder: bool
    damping: bool
    coriolis: bool
    air: bool
    turn: bool


@lru_cache(maxsize=64)
def _kinds(model: VesselModel) -> tuple[Kind, ...]:
    return tuple(
        Kind(
            name=term.name,
            equation=term.equation,
            evaluate=expression.evaluate,
            thrust=is_thrust(expression, model),
            rudder=reads_rudder(expression),
            damping=is_damping(term, expression, model),
            coriolis=is_coriolis(term),
            air=bool({"u_q", "v_q"} & set(expression.signals)),
            turn="tau_psi" in expression.signals,
        )
        for term, expression in zip(model.terms, model.expressions, strict=True)
    )


def ahead_force(signals: Mapping[str, Array], model: VesselModel) -> Array:
    """tau_x, of rudder ships n |n| of their propellers."""
    if any(set(e.signals) & set(FORCE_SIGNALS) for e in model.expressions):
        return signals["tau_x"]
    speeds = [signals[name] for name in model.inputs if name.rstrip("0123456789") == "n"]
    return sum((np.abs(n) * n for n in speeds), np.zeros(1))


def is_coriolis(term: Term) -> bool:
    """X_vr and Y_ur: ratios of inertias, which a change of load nearly keeps."""
    text = term.expression.replace(" ", "")
    return (term.equation, text) in {("u", "v*r"), ("u", "r*v"), ("v", "u*r"), ("v", "r*u")}


def is_thrust(expression: Expression, model: VesselModel) -> bool:
    """It reads an input."""
    return bool(set(expression.signals) & {*FORCE_SIGNALS, *model.inputs})


def reads_rudder(expression: Expression) -> bool:
    """It reads a rudder angle."""
    return any(name.startswith("rudder") for name in expression.signals)


def is_damping(term: Term, expression: Expression, model: VesselModel) -> bool:
    """It resists: neither an input, nor air, nor Coriolis."""
    return not (is_thrust(expression, model) or is_coriolis(term) or {"u_q", "v_q"} & set(expression.signals))


def observed(ship: Extended, states: Array, windows: Windows, turned: Array | None = None) -> Array:
    """(w, s, 4) channels that the sensors would show.

    Args:
        ship: its sensors.
        states: (w, k, n) at integrator steps.
        windows: what is measured, and when.
        turned: (w, k) heading since the start; integrated from the yaw rate when None.
    """
    u, v, r = np.moveaxis(states[:, :: windows.steps_per_sample, :3], -1, 0)
    u, v = u - ship.get("lever:starboard") * r, v + ship.get("lever:forward") * r
    bias = ship.get("heading_bias")
    if bias:
        u, v = u * np.cos(bias) - v * np.sin(bias), v * np.cos(bias) + u * np.sin(bias)
    late = ship.get("late:psi")
    if late:
        turned = r * late
        u, v = u * np.cos(turned) - v * np.sin(turned), v * np.cos(turned) + u * np.sin(turned)
    channels = {"u": u, "v": v, "r": (1 + ship.get("gyro")) * r, "psi_rate": r}
    for name in channels if windows.derived else ("psi_rate",):
        channels[name] = averaged(channels[name])
    if turned is not None:
        channels["psi_rate"] = differenced(turned[:, :: windows.steps_per_sample], channels["psi_rate"], windows)
        channels["r"] = (1 + ship.get("gyro")) * channels["psi_rate"] if windows.derived else channels["r"]
    for name, keys in LATE.items():
        delay = sum(ship.get(f"late:{key}") for key in keys)
        if delay:
            channels[name] = _shifted(channels[name], delay / windows.sample_s)
    if ship.get("late:position") and windows.derived:
        turned = -r * ship.get("late:position")
        channels["u"], channels["v"] = (
            channels["u"] * np.cos(turned) - channels["v"] * np.sin(turned),
            channels["v"] * np.cos(turned) + channels["u"] * np.sin(turned),
        )
    return np.stack(list(channels.values()), axis=-1)


LATE = {"u": ("u", "position"), "v": ("v", "position"), "r": ("r", "psi"), "psi_rate": ("psi",)}


def differenced(turned: Array, otherwise: Array, windows: Windows) -> Array:
    """Central differences (w, s) of a heading; at the ends what is given."""
    result = otherwise.copy()
    result[:, 1:-1] = (turned[:, 2:] - turned[:, :-2]) / (2 * windows.sample_s)
    return result


def averaged(values: Array) -> Array:
    """What central differences see of a velocity (..., w, s): its mean over two samples, by Simpson's rule."""
    result = values.copy()
    result[..., 1:-1] = (values[..., :-2] + 4 * values[..., 1:-1] + values[..., 2:]) / 6
    return result


def _shifted(values: Array, samples: float) -> Array:
    """Late by a number of samples, straight in between; the first value before the window begins."""
    place = np.clip(np.arange(values.shape[1]) - samples, 0, values.shape[1] - 1)
    low = np.floor(place).astype(int)
    share = place - low
    high = np.minimum(low + 1, values.shape[1] - 1)
    return np.asarray(values[:, low] * (1 - share) + values[:, high] * share)
