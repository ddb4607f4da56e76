"""What a run is, in words that a bridge says; and what ship to take it for where no vessel file tells."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from expdesign.errors import InputError, NoAnswer
from expdesign.importing.runs import DRIVE_SHARE, inputs_of
from expdesign.importing.sampling import Stretch
from expdesign.indices import NotStandard, measured_trial
from expdesign.indices.criteria import Circle, Stop, ZigZag
from expdesign.signals import Batch
from expdesign.simulation.helm import Helm
from expdesign.values import Array
from expdesign.vessel import Actuator, Limit, Term, Vessel, VesselModel

BY = {"": "", "rudder": "", "force": "", "azimuth": " by azimuths", "propeller": " by differential thrust"}
"""How a ship steers, as `Helm` has it -> words behind the name of a trial."""
STEERED = (("rudder", "helm"), ("a", "azimuths"), ("tau_psi", "helm"))
"""Stem of inputs -> words where they change."""
ON_THE_LINE: Mapping[str, float] = {}
"""All propellers on the centre line."""


def presumed(
    stretches: Sequence[Stretch],
    *,
    length_m: float,
    sample_time_s: float,
    bow: Sequence[str],
    sides: Mapping[str, float] = ON_THE_LINE,
) -> Vessel:
    """A ship of this length with the recorded inputs, whose answers have the size that the record shows.

    Only her signs are presumed: propellers drive her ahead, rudders and moments to starboard turn her to starboard.

    Args:
        stretches: with the same columns.
        length_m: of the ship [m].
        sample_time_s: of the record [s].
        bow: signals of thrusters across the bow, e.g. ("n3",).
        sides: signal -> -1 for a propeller to port, 1 to starboard. Of two whose sides nothing tells, the first is to
            port where there is no rudder.
    """
    inputs = [inputs_of(stretch.columns) for stretch in stretches]
    names = [name for name in inputs[0] if all(name in own for own in inputs)]
    actuators = _actuators(
        names, {name: max(float(np.abs(own[name]).max()) for own in inputs) for name in names}, length_m, bow, sides
    )
    terms = [Term("u", "X_abs_u_u", "abs(u)*u"), Term("v", "Y_abs_u_v", "abs(u)*v"), Term("r", "N_abs_u_r", "abs(u)*r")]
    values = [-0.05 / length_m, -1.0 / length_m, -1.0 / length_m]
    rudders = [one.signals[0] for one in actuators if one.kind == "rudder"]
    if any(one.kind != "rudder" for one in actuators):
        terms += [Term("u", "X_mu", "tau_x"), Term("r", "N_mu", "tau_psi")]
        values += [1e-3, 1e-3 / length_m]
    for rudder in rudders:
        terms.append(Term("r", f"N_{rudder}", f"abs(u)*u*sin({rudder})"))
        values.append(1.0 / length_m**2 / len(rudders))
    model = VesselModel(
        terms=tuple(terms), parameters=np.array(values), parameter_std=np.zeros(len(values)), form="continuous",
        sample_time_s=sample_time_s, actuators=actuators,
    )  # fmt: skip
    return Vessel(
        name="presumed", length_m=length_m, beam_m=length_m / 5, draught_m=length_m / 15, sample_time_s=sample_time_s,
        model=model,
    )  # fmt: skip


def fitted(ship: Vessel, batches: Sequence[Batch]) -> Vessel:
    """The presumed ship with answers of the size that these data show, and the signs that she is presumed to have."""
    parameters = np.array(ship.model.parameters)
    for axis, output in ((0, "u"), (2, "r")):
        rows = [k for k, term in enumerate(ship.model.terms) if term.equation == output]
        x, y = [], []
        for batch in batches:
            own = dict(zip(batch.input_names, batch.inputs.T, strict=True))
            if not set(ship.model.inputs) <= set(own):
                return ship
            phi = _regressors(ship, batch, [own[name] for name in ship.model.inputs])
            good = np.isfinite(phi).all(axis=0) & np.isfinite(batch.velocity[:, axis])
            x.append(phi[rows][:, good].T)
            y.append(np.gradient(np.where(good, batch.velocity[:, axis], 0.0), batch.sample_time_s)[good])
        theta = np.linalg.lstsq(np.concatenate(x), np.concatenate(y), rcond=None)[0]
        for row, value in zip(rows, theta.tolist(), strict=True):
            parameters[row] = math.copysign(max(abs(value), 1e-12), parameters[row])
    return replace(ship, model=replace(ship.model, parameters=parameters))


def _regressors(ship: Vessel, batch: Batch, inputs: Sequence[Array]) -> Array:
    """(p, k) what each parameter multiplies."""
    signals = dict(zip(ship.model.inputs, inputs, strict=True))
    unit, rows = np.zeros(len(ship.model.parameters)), []
    velocity = np.where(np.isfinite(batch.velocity), batch.velocity, 0.0)
    for k, term in enumerate(ship.model.terms):
        alone = replace(ship.model, parameters=np.eye(len(unit))[k])
        axis = "uvr".index(term.equation)
        acceleration = alone.accelerations(
            velocity.T, velocity.T[:2], np.array([signals[name] for name in ship.model.inputs])
        )
        rows.append(np.broadcast_to(np.asarray(acceleration[axis], dtype=float), (len(batch),)))
    return np.array(rows)


def _actuators(
    names: Sequence[str], sizes: Mapping[str, float], length_m: float, bow: Sequence[str], sides: Mapping[str, float]
) -> tuple[Actuator, ...]:
    found = []
    fixed = [name.removesuffix("_rps") for name in names if name[0] == "n" and f"a{name[1:-4]}_rad" not in names]
    fixed = [name for name in fixed if name not in bow]
    if len(fixed) == 2 and not sides and not any(name.startswith("rudder") for name in names):
        sides = dict(zip(sorted(fixed), (-1.0, 1.0), strict=True))
    if any(name.startswith("tau") for name in names):
        limit = [
            Limit(
                low=-1.2 * max(sizes.get(f"tau_{axis}", 0.0), 1e-3), high=1.2 * max(sizes.get(f"tau_{axis}", 0.0), 1e-3)
            )
            for axis in ("x", "y", "psi")
        ]
        found.append(Actuator(kind="force", number=1, limits=tuple(limit)))
    numbers = sorted({int("".join(c for c in name if c.isdigit())) for name in names if name[0] in "na"})
    for number in numbers:
        alike = [f"{name}_rps" for name in sides] if f"n{number}" in sides else [f"n{number}_rps"]  # port as starboard
        size = 1.2 * max(max((sizes[name] for name in alike if name in sizes), default=1.0), 1e-3)
        speed, turns = Limit(low=-size, high=size), f"a{number}_rad" in names
        kind = "azimuth" if turns else "tunnel" if f"n{number}" in bow else "propeller"
        place = 0.4 * length_m if kind == "tunnel" else -0.45 * length_m
        found.append(
            Actuator(
                kind=kind, number=number, forward_m=place, limits=(speed, Limit()) if turns else (speed,),
                starboard_m=0.0 if turns else sides.get(f"n{number}", 0.0) * 0.1 * length_m,
            )
        )  # fmt: skip
    for name in sorted(name for name in names if name.startswith("rudder")):
        number = int("".join(c for c in name if c.isdigit()))
        found.append(
            Actuator(kind="rudder", number=number, forward_m=-0.5 * length_m, limits=(Limit(low=-1.6, high=1.6),))
        )
    return tuple(found)


def family(ship: Vessel, batch: Batch) -> str:
    """What a run is, in words, as the indices read it; else which inputs change."""
    try:
        like = _with_helm(ship, batch)
        found, by = measured_trial(*like), BY[Helm(vessel=like[0]).means]
    except (InputError, NoAnswer):  # a run that no index describes is named by its inputs
        found, by = NotStandard(name=batch.name, reason=""), ""
    match found:
        case ZigZag():
            helm = "" if by == BY["propeller"] else f"/{math.degrees(found.helm_rad):.0f}"
            return f"zig-zag {math.degrees(found.heading_rad):.0f}{helm}{by} {found.side}".strip()
        case Circle():
            helm = "" if by == BY["propeller"] else f" {math.degrees(found.helm_rad):.0f}"
            return f"turning circle{helm}{by} {found.side}"
        case Stop():
            return "stop"
    return _changes(ship, batch)


def _changes(ship: Vessel, batch: Batch) -> str:
    """Which inputs change, in words."""
    columns = dict(zip(batch.input_names, batch.inputs.T, strict=True))
    moved = {
        name: values for name, values in columns.items()
        if np.ptp(values) > DRIVE_SHARE * max(float(np.abs(values).max()), 1e-9)
    }  # fmt: skip
    parts = [words for stem, words in STEERED if any(name.startswith(stem) for name in moved)]
    bow = [one.signals[0] for one in ship.actuators if one.kind == "tunnel" and one.signals[0] in moved]
    parts += ["bow thruster"] * bool(bow)
    drives = [values for name, values in moved.items() if name.startswith(("n", "tau_x")) and name not in bow]
    if drives:
        apart, size = np.ptp(drives, axis=0), max(float(np.abs(drives).max()), 1e-9)
        if len(drives) > 1 and float(np.ptp(apart)) > DRIVE_SHARE * size:
            parts.append("differential thrust")
        if float(np.ptp(np.mean(drives, axis=0))) > DRIVE_SHARE * size:
            parts.append("speed")
    if parts == ["speed"]:
        return "changes of speed"
    return " and ".join(parts) or "steady"


def _with_helm(ship: Vessel, batch: Batch) -> tuple[Vessel, Batch]:
    """The same where inputs are forces: their moment taken for a rudder of 35 degrees at most."""
    if not any(one.kind in ("propeller", "azimuth", "force") for one in ship.actuators):  # only her helm is recorded
        names, inputs = (*batch.input_names, "n1"), np.column_stack([batch.inputs, np.ones(len(batch))])
        columns = {f"{n}_rps" if n == "n1" else f"{n}_rad": own for n, own in zip(names, inputs.T, strict=True)}
        batch = replace(batch, input_names=names, inputs=inputs, reached=(), planned=None, delivered=None)
        stretch = Stretch(time_s=batch.time_s, columns=columns)
        return presumed([stretch], length_m=ship.length_m, sample_time_s=batch.sample_time_s, bow=()), batch
    if "tau_psi" not in batch.input_names:
        return ship, batch
    ahead, moment = (batch.inputs[:, batch.input_names.index(name)] for name in ("tau_x", "tau_psi"))
    helm = math.radians(35.0) * moment / max(float(np.abs(moment).max()), 1.0)
    names = ("n1_rps", "rudder1_rad")
    stretch = Stretch(time_s=batch.time_s, columns=dict(zip(names, (ahead, helm), strict=True)))
    like = presumed([stretch], length_m=ship.length_m, sample_time_s=batch.sample_time_s, bow=())
    return like, replace(batch, input_names=("n1", "rudder1"), inputs=np.stack([ahead, helm], axis=1), reached=())
