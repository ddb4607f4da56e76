"""`expdesign incline`: what inclining tests and a roll decay tell of a ship's metacentric height and roll inertia."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

from expdesign.errors import FileError, NoAnswer
from expdesign.export import write_files
from expdesign.export.document import Table
from expdesign.export.files import finite, strict_json
from expdesign.loading import Inclining, heel_in_waves, inclining
from expdesign.progress import Progress, silent
from expdesign.scenario import load_vessel
from expdesign.vessel import RollPendulum
from expdesign.workflows.outcome import Outcome, document_of

HEADER = ("mass [kg]", "shift [m]", "heel [deg]", "std of GM [m]", "std of GM [%]", "std of inertia [%]")


def incline(
    vessel: Path,
    out: Path | None,
    *,
    mass_kg: Sequence[float],
    shift_m: Sequence[float],
    heel_std_deg: float = 0.02,
    period_std_s: float | None = None,
    shifts: int = 4,
    read_s: float = 60.0,
    progress: Progress = silent,
) -> Outcome:
    """A row for every mass and shift, into incline.json in `out` or runs/<vessel>-incline.

    Args:
        vessel: file with [roll]; what is on board by [roll.load] counts as part of the ship.
        out: folder, or None.
        mass_kg: of weights that are on board, and are shifted.
        shift_m: across the ship.
        heel_std_deg: of one reading of the change of heel, in still water; waves of the file come on top.
        period_std_s: of the roll period of a decay; None without one.
        shifts: readings.
        read_s: time over which each reading of heel is averaged, which counts in waves.
        progress: of the command.

    Raises:
        InputError: the file has no [roll], or a number is not positive.
        NoAnswer: the ship does not stay upright.
    """
    ship = load_vessel(vessel)
    pendulum = ship.pendulum
    if pendulum is None:
        raise FileError(vessel, "roll", "is missing, expected a table [roll] with masses and heights")
    if not pendulum.righting_nm > 0:
        raise NoAnswer(
            f"{ship.name} does not stay upright: her metacentric height is {pendulum.metacentric_height_m:.3g} m"
        )
    pairs = [(mass, shift) for mass in mass_kg for shift in shift_m]
    rolling, left = (math.degrees(one) for one in heel_in_waves(pendulum, read_s))
    left *= math.sqrt(2.0)  # a change of heel is that of two readings
    heel_in_all_deg = math.hypot(heel_std_deg, left) if heel_std_deg > 0 else heel_std_deg
    found = [_tested(pendulum, pair, heel_in_all_deg, period_std_s, shifts) for pair in pairs]
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
        summary |= {"roll_in_waves_deg": rolling, "left_of_waves_deg": left, "read_s": read_s}
    told = () if pendulum.waves is None else _in_waves(rolling, left, read_s, heel_std_deg, period_std_s)
    files = write_files(
        out or Path("runs") / f"{ship.name}-incline",
        {"incline.json": strict_json({**summary, "tests": rows, "remarks": list(told)})},
    )
    progress("done", 1.0)
    table = [_row(pendulum, pair, one) for pair, one in zip(pairs, found, strict=True)]
    tests = Table(title="Inclining tests", header=HEADER, rows=tuple(table))
    return Outcome(files=files, document=document_of({**summary, "remarks": told}, (tests,)))


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
