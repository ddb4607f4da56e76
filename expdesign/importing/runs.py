"""Where runs begin and end in a record, and what a run is in words that a bridge says.

A run is a stretch in which helm or engine orders act, with the approach before it. It ends where the helm is amidships
and the engine order stands, for about the time in which a ship sails three of her lengths; what lies between two runs
further than that is left out. With a plan, runs are where its commands are found again, each with its approach, too.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.errors import InputError, NoAnswer
from expdesign.importing.sampling import Sampled, Stretch
from expdesign.indices import NotStandard, measured_trial
from expdesign.indices.criteria import Circle, Stop, ZigZag
from expdesign.records.file import REACHED, is_input
from expdesign.signals import Batch, Commands
from expdesign.simulation.helm import Helm
from expdesign.values import Array
from expdesign.vessel import Actuator, Limit, Term, Vessel, VesselModel

QUIET_LENGTHS, QUIET_S = 3.0, (5.0, 60.0)  # way in ship lengths, and time [s], that a pause between two runs must last
FROUDE = 0.2  # of a ship whose length is not known: length = speed^2 / (g Froude^2)
HELM_SHARE, LEAST_HELM = 0.25, {"rad": math.radians(3.0), "tau": 0.05}
"""Share of the largest helm, and least helm, that is steering for a trial and not for a course."""
DRIVE_SHARE = 0.1  # change of the engine order, by its largest, that begins a run
SETTLED = 0.02  # change of speed over a pause, by the largest speed, below which a ship is settled
LONGEST_SETTLING = 20.0  # pauses after a change of the engine order in which the speed may go on changing
WHOLE = 0.8  # share of a stretch that acts from which it is one run
LEAST_SPEED = 0.1  # m/s
LONGEST_NAME = 40  # letters of a family in the name of a file
FOUND = 0.5  # squared correlation from which a plan's commands are found in a record


@dataclass(frozen=True, kw_only=True, eq=False)
class Run:
    """Rows that belong together."""

    name: str
    family: str  # in words
    stretch: Stretch
    approach_s: float  # before the first order


def inputs_of(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Signal column, e.g. n1_rps -> values that act: the position reached where it is recorded, else the order."""
    names = dict.fromkeys(name.removeprefix(REACHED) for name in columns if is_input(name.removeprefix(REACHED)))
    return {name: columns.get(REACHED + name, columns.get(name, np.zeros(0))) for name in names}


def typical_length_m(stretches: Sequence[Stretch]) -> float:
    """Length of a ship that makes such speeds [m]."""
    speeds = [
        np.hypot(s.columns["u_mps"], s.columns["v_mps"]) for s in stretches if {"u_mps", "v_mps"} <= set(s.columns)
    ]
    return length_of_speed_m(np.concatenate(speeds) if speeds else np.zeros(0))


def length_of_speed_m(speeds: Array) -> float:
    """Length of a ship of these speeds, (k,) in m/s [m]."""
    speed = float(np.quantile(np.abs(speeds), 0.8)) if len(speeds) else 3.0
    return max(1.0, speed**2 / (9.81 * FROUDE**2))


def cut(found: Sampled, *, length_m: float) -> list[Run]:
    """Runs in all stretches, in order; whole stretches where no order acts in any."""
    runs: list[Run] = []
    for stretch in found.stretches:
        inputs = inputs_of(stretch.columns)
        if not inputs:
            runs.append(Run(name="", family="no orders are recorded", stretch=stretch, approach_s=0.0))
            continue
        pause = max(3, round(_pause_s(stretch, length_m) / found.sample_time_s))
        acts = _acts(stretch, inputs, pause)
        if acts.mean() > WHOLE:
            first = int(np.argmax(acts))
            runs.append(Run(name="", family="", stretch=stretch, approach_s=first * found.sample_time_s))
            continue
        edges = np.flatnonzero(np.diff(np.r_[False, acts, False].astype(int)))
        begin = 0
        for first, last in _joined(edges.reshape(-1, 2).tolist(), pause):
            start = max(begin, first - 2 * pause)
            end = min(len(stretch), last + pause // 2)
            runs.append(
                Run(
                    name="",
                    family="",
                    stretch=stretch.cut(slice(start, end)),
                    approach_s=(first - start) * found.sample_time_s,
                )
            )
            begin = end
    whole = (Run(name="", family="", stretch=stretch, approach_s=0.0) for stretch in found.stretches)
    return runs or list(whole)


def _pause_s(stretch: Stretch, length_m: float) -> float:
    u = stretch.columns.get("u_mps")
    speed = max(float(np.median(np.abs(u))), LEAST_SPEED) if u is not None else 3.0
    return float(np.clip(QUIET_LENGTHS * length_m / speed, *QUIET_S))


def _acts(stretch: Stretch, inputs: Mapping[str, Array], pause: int) -> np.ndarray:
    """(k,) where helm or engine orders act."""
    acts = np.zeros(len(stretch), dtype=bool)
    for kinds, least in ((("rudder", "a"), LEAST_HELM["rad"]), (("tau_psi",), LEAST_HELM["tau"])):
        own = [values for name, values in inputs.items() if name.startswith(kinds)]
        if own:
            helm = np.abs(np.mean([np.angle(np.exp(1j * v)) if kinds[0] == "rudder" else v for v in own], axis=0))
            acts |= helm > max(least, HELM_SHARE * float(np.quantile(helm, 0.98)))
    drives = [values for name, values in inputs.items() if name.startswith(("n", "tau_x"))]
    if drives:
        drive = np.mean(drives, axis=0)
        size = max(float(np.abs(drives).max()), 1e-9)
        sides = np.max([_beside(own, drive, size) for own in drives], axis=0)
        two, rows = max(1, pause // 5), np.arange(len(drive))
        later, sooner = drive[np.minimum(rows + two, rows[-1])], drive[np.maximum(rows - two, 0)]
        changed = np.abs(later - sooner) > DRIVE_SHARE * size
        acts |= changed | (np.abs(sides - np.quantile(sides, 0.2)) > DRIVE_SHARE * size)
        u = stretch.columns.get("u_mps")
        if u is not None:
            smooth = scipy.ndimage.uniform_filter1d(u, pause)
            ahead = np.r_[smooth[pause:], np.full(pause, smooth[-1])] if len(u) > pause else smooth
            moving = np.abs(ahead - smooth) > SETTLED * max(float(np.abs(smooth).max()), LEAST_SPEED)
            last = np.maximum.accumulate(np.where(changed, np.arange(len(u)), -(10**9)))
            acts |= moving & (np.arange(len(u)) - last < LONGEST_SETTLING * pause)
    return acts


def _beside(own: Array, drive: Array, size: float) -> Array:
    """(k,) how far one side is from what it always is beside all: nothing where its engine is never in use."""
    lone, all_ = own - own.mean(), drive - drive.mean()
    apart = np.abs(lone - float(lone @ all_) / max(float(all_ @ all_), 1e-18) * all_)
    return apart if float(np.quantile(apart, 0.95)) < DRIVE_SHARE * size else np.abs(own - drive)


def _joined(parts: Sequence[Sequence[int]], pause: int) -> list[tuple[int, int]]:
    """Stretches of action with no pause between; shorter than a fifth of one is steering."""
    found: list[tuple[int, int]] = []
    for first, last in parts:
        if found and first - found[-1][1] < pause:
            found[-1] = found[-1][0], last
        else:
            found.append((first, last))
    return [(first, last) for first, last in found if last - first >= max(3, pause // 5)]


def cut_by_plan(
    found: Sampled, commands: Commands, legs: Sequence[tuple[str, int, int]], *, length_m: float
) -> tuple[list[Run], str]:
    """Runs of a plan by their names, and a sentence on where they were found.

    Args:
        found: with orders or positions of the same signals.
        legs: name, first and last sample of each run.
        length_m: of the ship, some of which are the approach before a run's first order.
    """
    best: tuple[float, int, int] | None = None
    ratio = commands.sample_time_s / found.sample_time_s
    times = np.arange(math.floor(len(commands) * ratio)) / ratio
    for place, stretch in enumerate(found.stretches):
        inputs = {name.removesuffix("_rps").removesuffix("_rad"): v for name, v in _orders(stretch.columns).items()}
        shared = [name for name in commands.names if name in inputs and np.ptp(commands.column(name)) > 0]
        top = bottom = 0.0
        for name in shared:
            plan = commands.column(name)[np.minimum(times.astype(int), len(commands) - 1)]
            plan, seen = plan - plan.mean(), inputs[name] - inputs[name].mean()
            scale = float(plan @ plan)
            top = top + scipy.signal.correlate(seen, plan, mode="full", method="fft") / scale
            area = scipy.signal.correlate(seen**2, np.ones(len(plan)), mode="full", method="fft")
            bottom = bottom + np.maximum(area, 1e-9 * max(float(area.max()), 1e-12)) / scale
        if not shared:
            continue
        score = np.where(np.asarray(top) > 0, np.asarray(top) ** 2 / (np.asarray(bottom) * len(shared)), 0.0)
        lag = int(np.argmax(score))
        if best is None or score[lag] > best[0]:
            best = float(score[lag]), place, lag - (len(times) - 1)
    if best is None:
        return [], f"the log has none of the plan's inputs, {', '.join(commands.names)}"
    explained, place, offset = best
    if explained < FOUND:
        return [], f"the plan's commands are not found in the log: they explain {explained:.0%} of its orders at best"
    stretch, runs, free = found.stretches[place], [], 0
    pause = round(_pause_s(stretch, length_m) / found.sample_time_s)
    for name, first, last in legs:
        begin, end = (min(max(offset + round(sample * ratio), 0), len(stretch)) for sample in (first, last))
        start = max(free, begin - pause)
        if end - begin > 20:
            approach_s = (begin - start) * found.sample_time_s
            runs.append(
                Run(name=name, family="as planned", stretch=stretch.cut(slice(start, end)), approach_s=approach_s)
            )
        free = max(free, end)
    begins = offset * found.sample_time_s
    return runs, f"the plan begins {begins:.1f} s after the record; its commands explain {explained:.0%} of the orders"


def _orders(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Signal column -> order where it is recorded, else the position reached."""
    return {name: columns.get(name, values) for name, values in inputs_of(columns).items()}


def file_name(number: int, run: Run) -> str:
    """Of a run's CSV: its number and family, letters and digits only; of values below zero, "minus"."""
    named = re.sub(r"(?<=-)-(?=[\d.])", "minus-", (run.name or run.family or "run").lower())
    words = "".join(c if c.isalnum() else "-" for c in named)
    parts = [part for part in words.split("-") if part]
    while len("-".join(parts)) > LONGEST_NAME and len(parts) > 1:
        parts.pop()
    return f"{number:02d}-{'-'.join(parts)[:LONGEST_NAME]}.csv"


BY = {"": "", "rudder": "", "force": "", "azimuth": " by azimuths", "propeller": " by differential thrust"}
"""How a ship steers, as `Helm` has it -> words behind the name of a trial."""
STEERED = (("rudder", "helm"), ("a", "azimuths"), ("tau_psi", "helm"))  # stem of inputs -> words where they change
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
