"""A table that a logger writes its own way is read as it is meant: clocks, places, angles, words, headers."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from expdesign.importing import guess, read_log
from foreign_tables import CLOCKS, STYLES
from logged_trial import Voyage, voyage


@pytest.fixture(scope="module")
def trip() -> Voyage:
    return voyage(parts=(("steady", 30.0), ("zigzag", 60.0))).every(10)


@pytest.mark.parametrize("style", STYLES)
def test_a_table_of_any_style_is_read_as_it_is_meant(style: str, tmp_path: Path, trip: Voyage) -> None:
    own = STYLES[style]
    (tmp_path / "a.csv").write_bytes(own.text(trip).encode(own.encoding))
    log = read_log(tmp_path / "a.csv")
    table = {channel.name: channel for channel in log.channels}
    found = {use.column: use.applied(table[use.channel]) for use in guess([log]).uses if use.column}
    sense = -1.0 if own.south else 1.0
    # of the digits that are written, tenths of a degree at most
    truths = {
        "lat_deg": (sense * trip.lat_deg, 1e-6), "lon_deg": (sense * trip.lon_deg, 1e-6),
        "sog_mps": (trip.speed_mps, 1e-4), "r_radps": (trip.r_radps, 1e-6), "n1_rps": (trip.n_rps, 1e-4),
        "rudder1_rad": (trip.order_rad, 1e-5), "reached_rudder1_rad": (trip.rudder_rad, 1e-5),
        "heading_rad": (trip.heading_rad, 1e-3), "cog_rad": (trip.course_rad, 1e-3),
    }  # fmt: skip
    found |= {"n1_rps": found[name] for name in ("reached_n1_rps",) if name in found}
    assert set(truths) <= set(found), {use.channel: (use.column, use.why) for use in guess([log]).uses}
    for name, (truth, bound) in truths.items():
        off = found[name].values - truth
        off = np.angle(np.exp(1j * off)) if name in ("heading_rad", "cog_rad") else off
        assert np.abs(off).max() < bound, name
        times = found[name].time_s - (trip.time_s if own.dated else trip.time_s - trip.time_s[0] + found[name].time_s[0])
        assert np.abs(times).max() < 0.06, (name, log.notes)  # of days in nine digits
    assert style not in CLOCKS or own.dated == (found["lat_deg"].time_s[0] > 1e9)
