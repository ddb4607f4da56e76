"""A run that begins faster than the vessel goes ends with status 3; the line names it and both speeds."""

from __future__ import annotations

import re

import numpy as np
import pytest

from design_case import SCENARIOS, spec, vessel
from expdesign.cli import main
from expdesign.dictionary import build_primitive
from expdesign.dictionary.trim import drift
from expdesign.errors import Unreachable
from expdesign.simulation import steady_ahead


def message(name: str, family: str, **settings: float) -> str:
    with pytest.raises(Unreachable) as caught:
        build_primitive(vessel(name), spec(family, name="odd one", **settings))
    text = str(caught.value)
    assert text.startswith("primitive 'odd one': ")
    assert "\n" not in text
    return text


def test_a_ship_steered_by_forces_reaches_what_full_thrust_holds():
    text = message("azimuth-30m", "deceleration", duration_s=60, speed_mps=5)
    # nominal model: X_u u + X_mu tau_x = 0 with both propellers at 15 rps
    assert "cannot hold its entry state u = 5 m/s" in text
    assert float(re.search(r"reach u = ([\d.]+) m/s", text)[1]) == pytest.approx(0.01 * 30 / 0.2, rel=1e-3)


@pytest.mark.parametrize("family", ["zigzag_heading", "turning_circle_helm", "crash_stop"])
def test_a_ship_with_a_rudder_reaches_what_full_ahead_holds(family):
    ship, text = vessel("coaster-80m"), message("coaster-80m", family, duration_s=60, speed_mps=9)
    assert "cannot hold 9 m/s" in text
    reached = float(re.search(r"reaches ([\d.]+) m/s", text)[1])
    left = drift(ship, np.array([reached, 0.0, 0.0]), np.array([3.4, 0.0]))  # full ahead
    np.testing.assert_allclose(left, 0.0, atol=1e-5)
    steady_ahead(ship, 0.999 * reached)


def test_motion_beyond_the_actuators_names_the_whole_desired_motion():
    text = message("model-ship", "inward_spiral", duration_s=10, speed_mps=5, yaw_rate_radps=0.1)
    assert "cannot hold its entry state u = 5 m/s" in text


def test_motion_astern_is_reported_astern():
    text = message("model-ship", "deceleration", duration_s=10, speed_mps=-20)
    desired, reached = (float(x) for x in re.findall(r"u = (-[\d.]+) m/s", text))
    assert desired == -20
    assert -20 < reached < 0


@pytest.mark.parametrize("command", ["score", "durations", "plan", "run"])
def test_the_commands_end_with_status_3_and_write_nothing(command, tmp_path, capsys):
    (tmp_path / "fast.toml").write_text(
        '[dictionary]\nname = "fast"\n[[primitives]]\nname = "too-fast"\nfamily = "zigzag_heading"\n'
        "duration_s = 100.0\nspeed_mps = 8.5\n"
    )
    text = (SCENARIOS / "coaster.toml").read_text()
    for kind in ("vessels", "areas"):
        text = text.replace(f'"{kind}/', f'"{SCENARIOS}/{kind}/')
    (tmp_path / "case.toml").write_text(text.replace("dictionaries/rudder-ship.toml", "fast.toml"))
    assert main([command, str(tmp_path / "case.toml"), "--out", str(tmp_path / "out"), "--quiet"]) == 3
    (line,) = capsys.readouterr().err.splitlines()
    assert "primitive 'too-fast'" in line
    assert "cannot hold 8.5 m/s" in line
    assert re.search(r"reaches 6\.95\d? m/s", line)
    assert not (tmp_path / "out").exists()
