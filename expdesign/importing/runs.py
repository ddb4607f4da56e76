"""Where runs begin and end in a record.

A run is a stretch in which helm or engine orders act, with the approach before it. It ends where the helm is amidships
and the engine order stands, for about the time in which a ship sails three of her lengths; what lies between two runs
further than that is left out. With a plan, runs are where its commands are found again.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import scipy

from expdesign.importing.sampling import Sampled, Stretch
from expdesign.records.file import REACHED, is_input
from expdesign.signals import Commands
from expdesign.values import Array

QUIET_LENGTHS, QUIET_S = 3.0, (5.0, 60.0)
"""Way in ship lengths, and time [s], that a pause between two runs must last."""
FROUDE = 0.2
"""Of a ship whose length is not known: length = speed^2 / (g Froude^2)."""
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
        sides = np.max([np.abs(own - drive) for own in drives], axis=0)
        size = max(float(np.abs(drives).max()), 1e-9)
        two = max(1, pause // 5)
        later, sooner = np.r_[drive[two:], np.full(two, drive[-1])], np.r_[np.full(two, drive[0]), drive[:-two]]
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


def _joined(parts: Sequence[Sequence[int]], pause: int) -> list[tuple[int, int]]:
    """Stretches of action with no pause between; shorter than a fifth of one is steering."""
    found: list[tuple[int, int]] = []
    for first, last in parts:
        if found and first - found[-1][1] < pause:
            found[-1] = found[-1][0], last
        else:
            found.append((first, last))
    return [(first, last) for first, last in found if last - first >= max(3, pause // 5)]


def cut_by_plan(found: Sampled, commands: Commands, legs: Sequence[tuple[str, int, int]]) -> tuple[list[Run], str]:
    """Runs of a plan by their names, and a sentence on where they were found.

    Args:
        found: with orders or positions of the same signals.
        legs: name, first and last sample of each run.
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
    stretch, runs = found.stretches[place], []
    for name, first, last in legs:
        begin, end = (offset + round(sample * ratio) for sample in (first, last))
        part = stretch.cut(slice(max(begin, 0), max(min(end, len(stretch)), 0)))
        if len(part) > 20:
            runs.append(Run(name=name, family="as planned", stretch=part, approach_s=0.0))
    begins = offset * found.sample_time_s
    return runs, f"the plan begins {begins:.1f} s after the record; its commands explain {explained:.0%} of the orders"


def _orders(columns: Mapping[str, Array]) -> dict[str, Array]:
    """Signal column -> order where it is recorded, else the position reached."""
    return {name: columns.get(name, values) for name, values in inputs_of(columns).items()}


def file_name(number: int, run: Run) -> str:
    """Of a run's CSV: its number and family, letters and digits only."""
    words = "".join(c if c.isalnum() else "-" for c in (run.name or run.family or "run").lower())
    parts = [part for part in words.split("-") if part]
    while len("-".join(parts)) > LONGEST_NAME and len(parts) > 1:
        parts.pop()
    return f"{number:02d}-{'-'.join(parts)[:LONGEST_NAME]}.csv"
