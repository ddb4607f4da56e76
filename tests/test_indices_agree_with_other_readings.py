"""Indices agree with plain readings of finely sampled motion, and with measured records of the same trials."""

import math
from pathlib import Path

import numpy as np
import pytest

from expdesign.errors import InputError
from expdesign.indices import Circle, NotStandard, Stop, ZigZag, measured_trial, standard_results
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import Batch
from expdesign.simulation import Conduct, steady_ahead, stopping, turning_circle, zigzag
from expdesign.vessel import Vessel
from measured_trials import TUG_TRUE, as_batch
from nomoto_ship import nomoto_ship
from sample_files import outside
from vessel_files import KVLCC2, write_vessel

RUNS = ("10_01", "10_05", "10_10_p", "15_01", "15_05", "20_10_p", "25_05", "30_05")
"""Helm and heading [deg] of the measured zig-zags."""
SPEED, TEN = 2.0, math.radians(10)
FINE = Conduct(speed_mps=SPEED, sample_time_s=0.02)


def test_the_tugs_circle_agrees_with_a_reading_of_fine_samples_to_half_a_per_cent() -> None:
    found = standard_results(TUG_TRUE, speed_mps=SPEED, sides=("port",)).circles[0]
    pose = turning_circle(TUG_TRUE, side="port", conduct=FINE)[1].pose
    quarter, half = (int(np.argmax(-pose[:, 2] >= angle)) for angle in (math.pi / 2, math.pi))
    assert found.advance_m == pytest.approx(pose[quarter, 0], rel=5e-3)
    assert found.transfer_m == pytest.approx(-pose[quarter, 1], rel=5e-3)
    assert found.tactical_diameter_m == pytest.approx(-pose[half, 1], rel=5e-3)


def test_the_tugs_zigzag_and_stop_agree_with_a_reading_of_fine_samples() -> None:
    found = standard_results(TUG_TRUE, speed_mps=SPEED, sides=("starboard",))
    heading = zigzag(TUG_TRUE, heading_rad=TEN, helm_rad=TEN, conduct=FINE)[1].pose[:, 2]
    assert found.zigzags[0].overshoots_rad == pytest.approx(
        (heading.max() - TEN, -heading.min() - TEN), rel=5e-3, abs=math.radians(0.1)
    )
    assert found.stops[0].track_reach_m == pytest.approx(stopping(TUG_TRUE, conduct=FINE)[1].pose[-1, 0], rel=5e-3)


@pytest.mark.parametrize("vessel", [nomoto_ship(), nomoto_ship(sense=1.0, bias=0.02), TUG_TRUE])
@pytest.mark.parametrize("side", ["starboard", "port"])
def test_a_record_of_a_trial_shows_what_the_trial_showed(vessel: Vessel, side: str) -> None:
    speed = 2.0 if vessel is TUG_TRUE else 7.0
    step = 0.1
    conduct = Conduct(speed_mps=speed, approach_s=30.0, sample_time_s=step)
    expected = standard_results(vessel, speed_mps=speed, sides=(side,))
    circle, zig = expected.circles[0], expected.zigzags[0]
    trial = turning_circle(vessel, side=side, conduct=conduct)
    found = measured_trial(vessel, as_batch(vessel, *trial, turn_rad=1.0))
    assert isinstance(found, Circle)
    assert (found.side, found.speed_mps) == (side, pytest.approx(steady_ahead(vessel, speed).speed_mps))
    for key in ("advance_m", "transfer_m", "tactical_diameter_m"):
        assert getattr(found, key) == pytest.approx(getattr(circle, key), rel=0.01, abs=2 * speed * step)
    trial = zigzag(vessel, heading_rad=TEN, helm_rad=TEN, side=side, conduct=conduct)
    swing = measured_trial(vessel, as_batch(vessel, *trial, turn_rad=-2.0))
    assert isinstance(swing, ZigZag)
    assert (swing.side, len(swing.executes)) == (side, 3)
    assert (swing.heading_rad, swing.helm_rad) == pytest.approx((TEN, TEN), rel=0.05)
    assert swing.overshoots_rad == pytest.approx(zig.overshoots_rad, abs=math.radians(0.4))


@pytest.mark.thorough
def test_a_recorded_stop_is_found_and_other_runs_give_the_reason_for_no_trial() -> None:
    ship = nomoto_ship()
    conduct = Conduct(speed_mps=7.0, approach_s=20.0)
    expected = standard_results(ship, speed_mps=7.0).stops[0]
    commands, motion = stopping(ship, conduct=Conduct(speed_mps=7.0, approach_s=20.0, duration_s=600.0))
    found = measured_trial(ship, as_batch(ship, commands, motion))
    assert isinstance(found, Stop)
    assert found.track_reach_m == pytest.approx(expected.track_reach_m, rel=0.01)
    assert any(remark.startswith("no current is taken out of track reach") for remark in found.remarks)
    record = as_batch(ship, commands, motion)
    for share, stopped in ((0.01, True), (0.1, False)):  # of the approach speed, where the logger was switched off
        last = int(np.flatnonzero(record.velocity[:, 0] > share * 7.0)[-1])
        cut = measured_trial(ship, record.cut(slice(last + 1)))
        assert isinstance(cut, Stop) == stopped
        if isinstance(cut, Stop):
            assert cut.track_reach_m == pytest.approx(found.track_reach_m, rel=0.01)
        elif isinstance(cut, NotStandard):
            assert f"makes {record.velocity[last, 0]:.2g} m/s ahead where the record ends" in cut.reason
    ahead = zigzag(ship, heading_rad=TEN, helm_rad=TEN, conduct=Conduct(speed_mps=7.0, approach_s=90, duration_s=80))
    straight = measured_trial(ship, as_batch(ship, *ahead))
    assert isinstance(straight, NotStandard)
    assert "no helm is held over, and the engines" in straight.reason
    short = turning_circle(ship, turn_rad=math.radians(60), conduct=conduct)
    part = measured_trial(ship, as_batch(ship, *short))
    assert isinstance(part, NotStandard)
    assert "one helm order, and the heading changes by" in part.reason
    batch = as_batch(ship, *short)
    with pytest.raises(InputError, match="no complete positions"):
        measured_trial(ship, Batch(**{**vars(batch), "pose": None}))


def test_positions_of_an_antenna_forward_are_brought_amidships() -> None:
    ship = nomoto_ship()
    trial = turning_circle(ship, conduct=Conduct(speed_mps=7.0, approach_s=20.0))
    batch = as_batch(ship, *trial)
    forward, pose, velocity = 30.0, np.array(batch.pose), np.array(batch.velocity)
    pose[:, :2] += forward * np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=1)
    velocity[:, 1] += forward * velocity[:, 2]
    moved = Batch(**{**vars(batch), "pose": pose, "velocity": velocity})
    one, two = measured_trial(ship, batch), measured_trial(ship, moved, reference_forward_m=forward)
    assert isinstance(one, Circle)
    assert isinstance(two, Circle)
    assert two.advance_m == pytest.approx(one.advance_m)
    assert two.tactical_diameter_m == pytest.approx(one.tactical_diameter_m)


@pytest.mark.outside
@pytest.mark.parametrize("run", RUNS)
def test_measured_zigzags_show_the_overshoots_that_plain_readings_show(run: str, tmp_path: Path) -> None:
    """They lie between two plain readings, with the order taken early and late in the rudder's movement."""
    vessel = load_vessel(write_vessel(tmp_path / "kvlcc2.toml", KVLCC2))
    batch = load_records(
        [outside(f"kvlcc2-hsva-7m/zigzag_{run}.csv")], vessel_inputs=vessel.model.inputs, sample_time_s=None
    ).batches[0]
    found = measured_trial(vessel, batch)
    assert isinstance(found, ZigZag)
    helm, heading = (float(part) for part in run.split("_")[:2])
    assert math.degrees(found.helm_rad) == pytest.approx(helm, abs=0.5)
    assert math.degrees(found.heading_rad) == pytest.approx(heading, abs=1.5)
    rudder, course = batch.inputs[:, 1], batch.pose[:, 2]
    count = len(found.overshoots_rad)
    early, late = (plain_overshoots(rudder, course, share * found.helm_rad)[:count] for share in (0.985, 0.9))
    assert count >= 2
    slack = math.radians(0.1)
    assert (np.array(found.overshoots_rad) < early + slack).all()
    assert (np.array(found.overshoots_rad) > late - slack).all()
    assert np.abs(early - late).max() < math.radians(1.5)


def plain_overshoots(rudder: np.ndarray, course: np.ndarray, plateau_rad: float) -> np.ndarray:
    """Largest headings beyond those at the last samples that the rudder is as far over as its plateau."""
    held = np.flatnonzero(np.abs(rudder) > plateau_rad)
    change = np.flatnonzero(np.diff(np.sign(rudder[held])) != 0)
    left, turned = held[change], held[change + 1]
    ends = [*left[1:], len(course) - 1]
    return np.array(
        [
            (np.sign(course[a]) * (course[t : b + 1] - course[a])).max()
            for a, t, b in zip(left, turned, ends, strict=True)
        ]
    )
