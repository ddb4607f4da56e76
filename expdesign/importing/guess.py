"""The mapping that names, units and readings suggest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from expdesign.importing.channels import Channel, Log
from expdesign.importing.machines import numbered
from expdesign.importing.mapping import COG, EASTWARD, MAGNETIC, NORTHWARD, SOG, FileClock, Mapping, Use
from expdesign.importing.names import COURSE_OR_HEADING, Mark, family_of, marked
from expdesign.importing.readings import used
from expdesign.vessel import Actuator


def guess(logs: Sequence[Log], actuators: Sequence[Actuator] = ()) -> Mapping:
    """The mapping that names, units and readings suggest.

    Args:
        logs: with clocks of their own or a common one.
        actuators: of the vessel, which number thrusters by their places; () where no vessel is known.
    """
    channels = [channel for log in logs for channel in log.channels]
    marks = [marked(channel) for channel in channels]
    if any(mark.column == "heading_rad" and mark.rank < COURSE_OR_HEADING for mark in marks):
        marks = [replace(mark, column=COG) if mark.rank == COURSE_OR_HEADING else mark for mark in marks]
    chosen = _best(channels, marks)
    uses = [
        used(channel, mark, channels, chosen) if chosen.get(mark.key) is channel else _unused(channel, mark, chosen)
        for channel, mark in zip(channels, marks, strict=True)
    ]
    by_machine = dict(numbered([(u, m) for u, m in zip(uses, marks, strict=True) if u.column], channels, actuators))
    uses = [by_machine.get(k, use) for k, use in ((id(use), use) for use in uses)]
    return Mapping(uses=tuple(uses), files=tuple(FileClock(file=log.source) for log in logs))


def _best(channels: Sequence[Channel], marks: Sequence[Mark]) -> dict[tuple[str, ...], Channel]:
    """The channel of each column: by rank of its name, then readings; companions from one sentence or message."""
    found: dict[tuple[str, ...], Channel] = {}
    for key in sorted({mark.key for mark in marks if mark.column}):
        own = [
            (m.rank + 10 * (np.ptp(c.values) == 0), -len(c), k)
            for k, (c, m) in enumerate(zip(channels, marks, strict=True))
            if m.key == key
        ]
        longest = max(-count for _, count, _ in own)
        own = [item for item in own if -item[1] > 0.1 * longest]
        found[key] = channels[min(own)[2]]
    for first, second in (("lat_deg", "lon_deg"), (SOG, COG), (NORTHWARD, EASTWARD), ("north_m", "east_m")):
        one = next((c for key, c in found.items() if key[0] == first), None)
        if one is None:
            continue
        for channel, mark in zip(channels, marks, strict=True):
            if mark.column == second and family_of(channel) == family_of(one):
                found[mark.key] = channel
                break
    there = {key[0] for key in found}
    for better, worse in (({"heading_rad"}, (MAGNETIC,)), ({"lat_deg", "lon_deg"}, ("north_m", "east_m"))):
        for name in worse if better <= there else ():
            found.pop((name, "", "", "", ""), None)
    return found


def _unused(channel: Channel, mark: Mark, chosen: dict[tuple[str, ...], Channel]) -> Use:
    better = chosen.get(mark.key)
    instead = {MAGNETIC: "the true heading", "north_m": "latitude", "east_m": "longitude"}.get(mark.column, "")
    why = f"{better.name} is used" if better is not None else "no quantity that is read"
    why = f"{instead} is used" if instead and better is None else why
    return Use(file=channel.source, channel=channel.name, why=why)
