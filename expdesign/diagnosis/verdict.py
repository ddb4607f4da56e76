"""What a diagnosis comes to, in one sentence: what is lacking, what adding it is worth, what would make sure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from expdesign.diagnosis.data import Windows
from expdesign.diagnosis.fit import DRAWS, HeldOut, on_same, units
from expdesign.diagnosis.values import Accuracy, Fall, Finding
from expdesign.values import Array

LOST_FIT = -300.0
"""Fit [%] below which the simulation has parted from the ship and the number says nothing more."""
LACKS = {
    "parameters": "the right values of some parameters",
    "current": "a current",
    "wind": "wind",
    "thrust_gain": "the right size of thrust",
    "thrust_advance_loss": "the loss of thrust with speed",
    "thruster_asymmetry": "an asymmetry of thrust",
    "actuator_lag": "the lag of the actuators",
    "actuator_delay": "the dead time of the actuators",
    "actuator_deadband": "the dead band of the actuators",
    "load_change": "the right inertia",
    "heading_bias": "the misalignment of a sensor",
    "lever_arm": "the distance of a sensor from amidships",
    "sensor_delay": "the delay of a sensor",
    "gyro_scale": "the scale of the rate gyro",
    "shallow_water": "shallow water",
    "roll_coupling": "an oscillation like roll",
    "change_point": "a change of the ship on the way",
}
VISIBLE = 0.01
"""Share of an error below which its fall is not worth a number."""
WORDS = {"u": "surge", "v": "sway", "r": "yaw"}
MANOEUVRES = {
    "zigzag": "a zig-zag", "zigzag_long": "a long zig-zag", "turning_circle": "a turning circle",
    "turning_circle_port": "a turning circle to port", "acceleration": "an acceleration",
    "deceleration": "a deceleration", "inward_spiral": "an inward spiral", "straight": "a straight run",
    "telegraph": "a run of random orders",
}  # fmt: skip
"""Standard proposals in words; those of a scenario's dictionary keep their names."""


def lacking(cause: str) -> str:
    """What the simulation lacks, e.g. of "missing_term:Y_r"."""
    kind, _, term = cause.partition(":")
    return f"the term {term}" if kind == "missing_term" else LACKS[kind]


def manoeuvre(name: str) -> str:
    """A proposal in words."""
    return MANOEUVRES.get(name, f"the manoeuvre {name}")


def error_falls(outputs: Sequence[str], before: HeldOut, after: HeldOut, seed: int) -> tuple[Fall, ...]:
    """Shares by which the simulated error of held-out runs falls, with 95 % intervals from drawing runs anew."""
    before, after = on_same(before, after)
    drawn = np.random.default_rng(seed).integers(0, len(before.lost), (DRAWS, len(before.lost)))

    def fall(lost_before: Array, lost_after: Array) -> Array:
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(1.0 - np.sqrt(lost_after / lost_before))

    whole = fall(before.lost.sum(axis=0), after.lost.sum(axis=0))
    falls = fall(before.lost[drawn].sum(axis=1), after.lost[drawn].sum(axis=1))
    low, high = np.nanquantile(falls, [0.025, 0.975], axis=0)
    rows = zip(outputs, whole.tolist(), low.tolist(), high.tolist(), strict=True)
    return tuple(Fall(output=name, share=share, low=least, high=most) for name, share, least, most in rows)


def telling(item: Finding) -> str:
    """What explains the data as well, and what would tell; empty where nothing does."""
    if not item.not_distinguishable_from:
        return ""
    rivals = listed([lacking(name) for name in item.not_distinguishable_from], "or")
    if item.would_tell_apart is None:
        return f"this data cannot tell {lacking(item.cause)} from {rivals}"
    many = len(item.not_distinguishable_from) > 1
    return (
        f"{manoeuvre(item.would_tell_apart)} would tell {lacking(item.cause)} from {rivals}, which "
        f"explain{'' if many else 's'} this data as well"
    )


def worth(item: Finding) -> str:
    """What adding it does to the output it surely helps most, e.g. "cuts the sway error by 52 % (45 to 60 %)"."""
    known = [fall for fall in item.falls if np.isfinite(fall.share)]
    if not known:
        return f"gains {item.gain:.1f} points of fit"
    best = max(known, key=lambda fall: fall.low)
    interval = f"({_percent(best.low)} to {_percent(best.high)} %)"
    if best.share < VISIBLE:
        return "takes less than 1 % off any error"
    way = "halves" if abs(best.share - 0.5) < 0.025 else "cuts"
    by = "" if way == "halves" else f" by {_percent(best.share)} %"
    return f"{way} the {WORDS[best.output]} error{by} {interval}"


def held_apart(windows: Windows) -> str:
    """What gains are measured on: runs, or stretches of them where there are too few."""
    return "runs" if np.array_equal(units(windows), windows.batch) else "stretches"


def verdict(findings: Sequence[Finding], before: Accuracy, apart: str = "runs") -> str:
    """The whole in one sentence.

    Args:
        findings: by gain.
        before: of the model in use.
        apart: what gains are measured on.
    """
    if not findings:
        return f"Nothing is wrong that this data can show: {fits(before)}."
    what = listed([lacking(item.cause) for item in findings])
    parts = [f"The simulation lacks {what}"]
    if len(findings) == 1:
        parts.append(f"adding it {worth(findings[0])} on {apart} it has not seen")
    else:
        gains = [f"{'adding ' if not i else ''}{lacking(item.cause)} {worth(item)}" for i, item in enumerate(findings)]
        parts.append(f"on {apart} it has not seen, {listed(gains)}")
    unseen = [item for item in findings if item.falls and all(not fall.share >= VISIBLE for fall in item.falls)]
    if unseen:
        names = "it" if len(findings) == 1 else listed([lacking(item.cause) for item in unseen])
        parts.append(f"{names} shows in a test, not yet in velocities as noisy as these")
    parts += [text for item in findings if (text := telling(item))]
    return "; ".join(parts) + "."


def fits(found: Accuracy) -> str:
    """How well a model does, in words where it is lost."""
    if lost(found):
        return "simulated over whole runs, the model parts from the ship altogether"
    rows = zip(found.outputs, found.fit.tolist(), strict=True)
    return f"it accounts for {listed([f'{value:.0f} % of {WORDS[name]}' for name, value in rows])}"


def lost(found: Accuracy) -> bool:
    """Whether some output has parted from the ship."""
    return bool((found.fit < LOST_FIT).any())


def listed(words: Sequence[str], last: str = "and") -> str:
    """A, B and C."""
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} {last} {words[-1]}"


def _percent(share: float) -> str:
    return f"{100 * share:.0f}".replace("-0", "0")
