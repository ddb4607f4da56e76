"""The model turned round: which force holds a motion, and which commands give that force."""

from __future__ import annotations

import math

import numpy as np

from expdesign.errors import InputError
from expdesign.values import Array
from expdesign.vessel.actuators import Actuator
from expdesign.vessel.expressions import SCALAR
from expdesign.vessel.model import VesselModel
from expdesign.vessel.structures import FORCE_SIGNALS


def required_force(model: VesselModel, velocity: Array, acceleration: Array) -> Array:
    """Generalised force (3,) that gives an acceleration (3,) at a velocity (3,) in calm water and air.

    The model must be affine in the generalised force. Directions that it cannot push (no equation, no gain) get the
    least-squares answer.

    Raises:
        InputError: a term reads an actuator signal directly, so force alone does not determine the motion.
    """
    signals = dict(zip(("u", "v", "r"), velocity.tolist(), strict=True)) | {"u_q": velocity[0], "v_q": velocity[1]}
    for term, expression in zip(model.terms, model.expressions, strict=True):
        direct = set(expression.signals) - set(signals) - set(FORCE_SIGNALS)
        if direct:
            raise InputError(
                f"term {term.name} reads {', '.join(sorted(direct))}: primitives are built for models that see their "
                f"actuators through {', '.join(FORCE_SIGNALS)}"
            )

    def response(force: Array) -> Array:
        table = signals | dict(zip(FORCE_SIGNALS, force.tolist(), strict=True))
        totals = dict.fromkeys(("u", "v", "r"), 0.0)
        for term, expression, value in zip(model.terms, model.expressions, model.parameters, strict=True):
            totals[term.equation] += float(value * expression.evaluate(table, SCALAR))
        return np.array(list(totals.values())) / model.time_scale_s

    free = response(np.zeros(3))
    gain = np.stack([response(unit) - free for unit in np.eye(3)], axis=1)  # (3 outputs, 3 forces)
    return np.asarray(np.linalg.lstsq(gain, acceleration - free, rcond=None)[0], dtype=float)


def force_matrix(actuators: tuple[Actuator, ...]) -> Array:
    """(3, c) generalised force of unit commands.

    Two columns (ahead, starboard) per azimuth, one per tunnel or propeller, the identity for plain forces.
    """
    columns: list[tuple[float, float, float]] = []
    for actuator in actuators:
        x, y = actuator.forward_m, actuator.starboard_m
        if actuator.kind == "force":
            columns += [(1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)]
        elif actuator.kind == "azimuth":
            columns += [(1.0, 0.0, -y), (0.0, 1.0, x)]
        elif actuator.kind == "tunnel":
            columns.append((0.0, 1.0, x))
        elif actuator.kind == "propeller":
            columns.append((1.0, 0.0, -y))
    return np.array(columns).T if columns else np.zeros((3, 0))


def allocate(
    actuators: tuple[Actuator, ...], force: Array, *, sample_time_s: float, before: Array | None = None
) -> Array:
    """Commands (k, m) for wished generalised forces (k, 3): smallest thrusts, then limits and rates.

    An azimuth turns the shorter way, reversing its propeller where that is nearer and gives as much; near zero thrust
    it keeps its angle. A saturated thruster is not relieved by the others. Rudders stay amidships.

    Args:
        actuators: in command order.
        force: (k, 3) tau_x, tau_y, tau_psi.
        sample_time_s: time between rows [s].
        before: (m,) commands standing before the first row, from which rates count; None for no rate limit there.
    """
    wished = force @ np.linalg.pinv(force_matrix(actuators)).T  # (k, c)
    rows, last = [], before
    for row in wished:
        last = _limited(actuators, row.tolist(), last, sample_time_s)
        rows.append(last)
    return np.array(rows)


def _limited(actuators: tuple[Actuator, ...], row: list[float], last: Array | None, sample_time_s: float) -> Array:
    parts, taken, place = [], 0, 0
    for actuator in actuators:
        count = len(actuator.limits)
        old = None if last is None else last[place : place + count]
        width = {"force": 3, "azimuth": 2, "rudder": 0}.get(actuator.kind, 1)
        wish = row[taken : taken + width]
        if actuator.kind == "azimuth":
            wish = _polar(wish[0], wish[1], old, actuator)
        elif actuator.kind == "rudder":
            wish = [0.0]
        for index, limit in enumerate(actuator.limits):
            value = min(max(wish[index], limit.low), limit.high)
            if old is not None:
                reach = limit.rate * sample_time_s
                value = min(max(value, old[index] - reach), old[index] + reach)
            parts.append(value)
        taken, place = taken + width, place + count
    return np.array(parts)


def _polar(ahead: float, side: float, old: Array | None, actuator: Actuator) -> list[float]:
    """Propeller speed and angle that come closest to a thrust within limits, by the shortest turn."""
    wish, bearing = math.hypot(ahead, side), math.atan2(side, ahead)
    reference = 0.0 if old is None else float(old[1])
    if wish < 1e-9:
        return [0.0, reference]
    speeds, angles = actuator.limits
    options = []
    for base in (bearing, bearing + math.pi):
        whole = round((reference - base) / (2 * math.pi))
        for turns in (whole - 1, whole, whole + 1):
            angle = min(max(base + 2 * math.pi * turns, angles.low), angles.high)
            along = math.cos(angle - bearing)
            speed = min(max(wish * along, speeds.low), speeds.high)
            missed = math.hypot(wish - speed * along, speed * math.sin(angle - bearing))
            options.append((round(missed / wish, 9), abs(angle - reference), speed, angle))
    return list(min(options)[2:])
