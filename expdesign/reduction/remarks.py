"""Remarks on what was undone of the sensors of a batch, and what could not be."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from expdesign.reduction.sensors import Stated, measured, off_centre, prompt, shrinkage
from expdesign.values import Array
from expdesign.vessel import Mounting

STATED = "As the vessel file states, "


def remarks(stated: Stated) -> Iterator[str]:
    """One sentence for each stated fault of a sensor in the data."""
    sensors, signals = stated.sensors, _signals(stated)
    for name, (words, values) in signals.items():
        mounting: Mounting = getattr(sensors, name)
        if not prompt(mounting):
            yield STATED + _timing(words, mounting, as_stated=stated.readings(name, values)[1])
        if off_centre(mounting) and name in PLACED:
            yield from _moved(words, mounting, stated)
    if "heading" in signals and sensors.heading_bias_rad:
        yield f"{STATED}{sensors.heading_bias_rad:.4g} rad is taken off the headings."
    if "velocity" in signals and sensors.velocity_angle_rad:
        yield from _along_axes(stated)
    if "velocity" in signals and sensors.velocity_scale != 1.0:
        yield f"{STATED}surge and sway speed are divided by {sensors.velocity_scale:.4g}."
    if "yaw_rate" in signals and sensors.yaw_rate_scale != 1.0:
        yield f"{STATED}the yaw rate is divided by {sensors.yaw_rate_scale:.4g}."
    if "wind" in signals and (shrunk := shrinkage(sensors)) < 1.0:
        yield f"{STATED}noise on the vane's angle shrinks the wind to {shrunk:.4g}; it is divided by that."


PLACED = ("position", "velocity", "wind")
WORDS = {"position": "positions", "heading": "headings", "velocity": "velocities", "yaw_rate": "yaw rates",
         "wind": "winds"}  # fmt: skip


def _signals(stated: Stated) -> dict[str, tuple[str, Array]]:
    """Sensor -> its words and measured values (k, c), for the sensors that the data come from."""
    batch = stated.batch
    values: dict[str, Array] = {}
    if batch.pose is not None:
        values |= {"position": batch.pose[:, :2], "heading": batch.pose[:, 2:]}
    if not {"u", "v"} <= set(batch.derived):
        values["velocity"] = batch.velocity[:, :2]
    if "r" not in batch.derived:
        values["yaw_rate"] = batch.velocity[:, 2:]
    if batch.wind is not None:
        values["wind"] = batch.wind
    return {name: (WORDS[name], part) for name, part in values.items() if measured(part)}


def _timing(words: str, mounting: Mounting, *, as_stated: bool) -> str:
    late = f"{words} are {mounting.delay_s:g} s late; they are moved to their own time" if mounting.delay_s else ""
    held = f"{words} are read every {mounting.interval_s:g} s; they are interpolated between readings"
    if mounting.interval_s and not as_stated:
        held = (
            f"{words} would be read every {mounting.interval_s:g} s, but change at other samples; every sample counts "
            "as a reading"
        )
    return ", and ".join(filter(None, (late, held if mounting.interval_s else ""))) + "."


def _moved(words: str, mounting: Mounting, stated: Stated) -> Iterator[str]:
    """What is done about a place off the reference point."""
    if words != WORDS["position"] and not measured(stated.batch.velocity[:, 2]):
        yield f"{words.capitalize()} are not moved from {_where(mounting)}, as that needs a yaw rate."
    elif words == WORDS["position"] and stated.batch.pose is not None and not measured(stated.batch.pose[:, 2]):
        yield f"{words.capitalize()} are not moved from {_where(mounting)}, as that needs a heading."
    else:
        yield f"{STATED}{words} are measured {_where(mounting)}; they are moved to amidships."


def _along_axes(stated: Stated) -> Iterator[str]:
    angle = stated.sensors.velocity_angle_rad
    if np.isfinite(stated.batch.velocity[:, :2]).any(axis=0).all():
        yield f"{STATED}velocities are measured along axes {angle:.4g} rad to starboard; they are turned to the ship's."
    else:
        yield f"Velocities are not turned by {angle:.4g} rad to the ship's axes, as that needs surge and sway."


def _where(place: Mounting) -> str:
    """A place in words, e.g. 6 m forward and 1 m to port."""
    parts = (
        (place.forward_m, f"{abs(place.forward_m):g} m {'forward' if place.forward_m > 0 else 'aft'}"),
        (place.starboard_m, f"{abs(place.starboard_m):g} m to {'starboard' if place.starboard_m > 0 else 'port'}"),
    )
    return " and ".join(words for size, words in parts if size)
