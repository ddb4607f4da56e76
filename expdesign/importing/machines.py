"""Signals of actuators: which machine one belongs to, its number, and whether it is an order or what was reached."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from expdesign.importing.channels import Channel
from expdesign.importing.mapping import Mapping, Use
from expdesign.importing.names import BOW, PORT, STARBOARD, Mark
from expdesign.importing.units import SHARES, words
from expdesign.values import Array
from expdesign.vessel import Actuator

STEPPED = 0.5  # share of all movement in single jumps from which a signal is an order


def numbered(
    used: Sequence[tuple[Use, Mark]], channels: Sequence[Channel], actuators: Sequence[Actuator]
) -> Iterator[tuple[int, Use]]:
    """Uses of actuators' signals with their columns, by the identity of the use without."""
    own = [(use, mark) for use, mark in used if mark.is_actuator]
    driven = {mark.machine for _, mark in own if mark.column in ("n", "throttle")}
    # an angle without revolutions beside it steers as a rudder does
    own = [
        (use, replace(mark, column="rudder") if mark.column == "a" and mark.machine not in driven else mark)
        for use, mark in own
    ]
    table = {(c.source, c.name): c for c in channels}
    shares = any(use.unit in SHARES for use, _ in own)
    forces = not actuators or any(one.kind == "force" for one in actuators)
    throttles = {mark.machine for _, mark in own if mark.column == "throttle"}
    as_forces = shares and forces and len(throttles) < 2 and not any(mark.column in ("n", "a") for _, mark in own)
    as_forces = as_forces and all(use.unit in SHARES for use, _ in own)  # an angle is no share
    machines = sorted({mark.machine for _, mark in own if mark.column != "rudder"}, key=_as_listed)
    rudders = sorted({mark.machine for _, mark in own if mark.column == "rudder"}, key=_as_listed)
    turning = {mark.machine for _, mark in own if mark.column == "a"}
    numbers = {machine: str(k) for k, machine in enumerate(machines, start=1)}
    numbers |= _by_place(machines, turning, actuators)
    for use, mark in own:
        roles = {other.role for _, other in own if (other.column, other.machine) == (mark.column, mark.machine)}
        reached, said = _is_reached(mark, roles, table[use.file, use.channel])
        prefix = "reached_" if reached else ""
        if as_forces:
            column, extra = ("tau_psi" if mark.column == "rudder" else "tau_x"), "as a share of the largest"
            yield id(use), replace(use, column=column, why=f"{use.why}; {extra}")
            continue
        if mark.column == "rudder":
            signal, scale = f"rudder{rudders.index(mark.machine) + 1}", _largest(actuators, "rudder", use)
        else:
            stem = "a" if mark.column == "a" else "n"
            signal, scale = f"{stem}{numbers[mark.machine]}", _largest(actuators, stem, use)
        column = f"{prefix}{signal}_{'rps' if signal[0] == 'n' else 'rad'}"
        unit_words = (
            ""
            if use.unit not in SHARES
            else f"; of {scale:.4g}, {'as the vessel file has it' if actuators else 'as nothing tells the largest'}"
        )
        yield id(use), replace(use, column=column, scale=use.scale * scale, why=f"{use.why}; {said}{unit_words}")


def _as_listed(machine: tuple[str, str, str]) -> tuple[str, str, str]:
    """Stern before bow, port before starboard, by number."""
    bow, side, number = machine
    return bow, number.rjust(3), side


def _largest(actuators: Sequence[Actuator], stem: str, use: Use) -> float:
    """What 100 per cent of an order are."""
    if use.unit not in SHARES:
        return 1.0
    limits = [
        limit.high for one in actuators for name, limit in zip(one.signals, one.limits, strict=True)
        if name.rstrip("0123456789") == stem and np.isfinite(limit.high)
    ]  # fmt: skip
    return limits[0] if limits else 1.0 if stem == "n" else np.pi / 180.0 * 35.0


def _by_place(
    machines: Sequence[tuple[str, str, str]], turning: set[tuple[str, str, str]], actuators: Sequence[Actuator]
) -> dict[tuple[str, str, str], str]:
    """Numbers in the vessel file, where places tell: tunnels are at the bow, sides are as signed."""
    found = {}
    for machine in machines:
        bow, side, number = machine
        kinds = ("tunnel",) if bow else ("azimuth",) if machine in turning else ("propeller", "azimuth")
        able = [one for one in actuators if one.kind in kinds]
        if side:
            able = [one for one in able if np.sign(one.starboard_m) == (-1.0 if side == "p" else 1.0)]
        elif number:
            able = [one for one in able if str(one.number) == number]
        if len(able) == 1:
            found[machine] = str(able[0].number)
    return found if len(set(found.values())) == len(found) else {}


def _is_reached(mark: Mark, roles: set[str], channel: Channel) -> tuple[bool, str]:
    """Whether a signal is a position that was reached, and why."""
    if mark.role:
        return mark.role == "reached", f"{'an order' if mark.role == 'order' else 'feedback'} by its name"
    if "order" in roles:
        return True, "feedback, as there is an order too"
    if "reached" in roles:
        return False, "the order, as there is feedback too"
    if not np.ptp(channel.values):
        return False, "an order, as it never changes"
    if jumps(channel.values):
        return False, "it jumps as an order does"
    return True, "it moves as an actuator does, so what was reached (give the column without reached_ for an order)"


def jumps(values: Array) -> bool:
    """Whether a signal moves mostly by jumps from one held value to the next, as orders do."""
    steps = np.diff(values)
    size = float(np.abs(steps).max(initial=0.0))
    if not size:
        return True
    moving = np.abs(steps) > 0.02 * size
    alone = moving & ~np.r_[False, moving[:-1]] & ~np.r_[moving[1:], False]
    return float(np.abs(steps[alone]).sum()) > STEPPED * float(np.abs(steps[moving]).sum())


def bow_signals(mapping: Mapping) -> tuple[str, ...]:
    """Signals of thrusters across the bow, by the names of their channels."""
    return tuple(
        use.column.removeprefix("reached_").removesuffix("_rps")
        for use in mapping.uses
        if re.search(BOW, words(use.channel)) and use.column.endswith("_rps")
    )


def sides(mapping: Mapping) -> dict[str, float]:
    """Signal of a thruster -> side that the name of its channel says, -1 for port."""
    found: dict[str, float] = {}
    for use in mapping.uses:
        if use.column.endswith("_rps"):
            name, signal = words(use.channel), use.column.removeprefix("reached_").removesuffix("_rps")
            side = -1.0 if re.search(PORT, name) else 1.0 if re.search(STARBOARD, name) else 0.0
            found |= {signal: side} if side else {}
    return found
