"""`expdesign incline`: what inclining tests and a roll decay tell of a ship's metacentric height and roll inertia."""

from __future__ import annotations

import math
from dataclasses import asdict
from pathlib import Path

from expdesign import requests
from expdesign.errors import FileError, NoAnswer
from expdesign.export.document import Table
from expdesign.export.files import finite, strict_json
from expdesign.loading import Inclining, heel_in_waves, inclining
from expdesign.progress import Progress, silent
from expdesign.scenario import load_vessel
from expdesign.vessel import RollPendulum
from expdesign.workflows.outcome import Outcome, document_of, finished, workflow

HEADER = ("mass [kg]", "shift [m]", "heel [deg]", "std of GM [m]", "std of GM [%]", "std of inertia [%]")


@workflow
def incline(request: requests.Incline, *, progress: Progress = silent) -> Outcome:
    """A row for every mass and shift, into incline.json in `out` or runs/<vessel>-incline.

    Raises:
        InputError: the file has no [roll], or a number is not positive.
        NoAnswer: the ship does not stay upright.
    """
    ship = load_vessel(request.vessel)
    pendulum = ship.pendulum
    if pendulum is None:
        raise FileError(request.vessel, "roll", "is missing, expected a table [roll] with masses and heights")
    if not pendulum.righting_nm > 0:
        raise NoAnswer(
            f"{ship.name} does not stay upright: her metacentric height is {pendulum.metacentric_height_m:.3g} m"
        )
    pairs = [(mass, shift) for mass in request.mass_kg for shift in request.shift_m]
    rolling, left = (math.degrees(one) for one in heel_in_waves(pendulum, request.read_s))
    left *= math.sqrt(2.0)  # a change of heel is that of two readings
    heel_in_all_deg = math.hypot(request.heel_std_deg, left) if request.heel_std_deg > 0 else request.heel_std_deg
    found = [_tested(pendulum, pair, heel_in_all_deg, request.period_std_s, request.shifts) for pair in pairs]
    rows = [
        {"mass_kg": mass, "shift_m": shift, **{name: finite(value) for name, value in asdict(one).items()}}
        for (mass, shift), one in zip(pairs, found, strict=True)
    ]
    summary = {
        "displacement_kg": pendulum.body.mass_kg + pendulum.load.mass_kg,
        "metacentric_height_m": pendulum.metacentric_height_m,
        "period_s": pendulum.period_s,
    }
    if pendulum.waves is not None:
        summary |= {"roll_in_waves_deg": rolling, "left_of_waves_deg": left, "read_s": request.read_s}
    told = (
        ()
        if pendulum.waves is None
        else _in_waves(rolling, left, request.read_s, request.heel_std_deg, request.period_std_s)
    )
    files = {"incline.json": strict_json({**summary, "tests": rows, "remarks": list(told)})}
    table = [_row(pendulum, pair, one) for pair, one in zip(pairs, found, strict=True)]
    tests = Table(title="Inclining tests", header=HEADER, rows=tuple(table))
    document = document_of({**summary, "remarks": told}, (tests,))
    return finished(request, Path("runs") / f"{ship.name}-incline", files, document, progress)


def _in_waves(
    rolling: float, left: float, read_s: float, heel_std_deg: float, period_std_s: float | None
) -> tuple[str, ...]:
    """What the waves of the vessel file do to readings of heel [deg] and to a decay."""
    heel = (
        f"The waves of [roll.waves] roll her by {rolling:.2g} degrees rms, beam on. Averaged over {read_s:g} s they "
        f"leave {left:.2g} degrees in a change of heel, which count beside the {heel_std_deg:g} degrees of the reading."
    )
    decay = "They disturb a decay, too: --period-std-s must hold what they do to the period."
    return (heel,) if period_std_s is None else (heel, decay)


def _tested(
    pendulum: RollPendulum, pair: tuple[float, float], heel_std_deg: float, period_std_s: float | None, shifts: int
) -> Inclining:
    return inclining(
        mass_kg=pair[0], shift_m=pair[1], displacement_kg=pendulum.body.mass_kg + pendulum.load.mass_kg,
        metacentric_height_m=pendulum.metacentric_height_m, period_s=pendulum.period_s,
        heel_std_rad=math.radians(heel_std_deg), period_std_s=math.inf if period_std_s is None else period_std_s,
        shifts=shifts,
    )  # fmt: skip


def _row(pendulum: RollPendulum, pair: tuple[float, float], one: Inclining) -> tuple[str, ...]:
    share = one.inertia_std_kgm2 / one.inertia_kgm2
    return (
        f"{pair[0]:g}", f"{pair[1]:g}", f"{math.degrees(one.heel_rad):.2f}", f"{one.metacentric_height_std_m:.2g}",
        f"{100 * one.metacentric_height_std_m / pendulum.metacentric_height_m:.2g}",
        f"{100 * share:.2g}" if math.isfinite(share) else "no decay",
    )  # fmt: skip
