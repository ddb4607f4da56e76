"""Instruments are compared before any model: faults are named with their size, clean records give no note."""

import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from expdesign.diagnosis.vessel_file.reading import extended_model
from expdesign.errors import FileError
from expdesign.kinematics.check import _disagreements, faster_than_stated
from expdesign.kinematics.instruments import Finding, log_against_positions
from expdesign.kinematics.relation import relation
from expdesign.records import load_records
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.vessel import Actuator, Limit, Response, Vessel
from expdesign.workflows import measured
from instrumented_ship import KINDS, NAMES, POSE, Log, voyages, write_log, write_vessel
from sample_files import outside, outside_record

DRAWN, COUNT = 8, 4  # voyages of each kind that are drawn together, and those of them that are read


def first_voyages(kind: str, **options: float) -> list[Log]:
    return voyages(DRAWN, kind, **options)[:COUNT]


@pytest.fixture(scope="module")
def ship(tmp_path_factory: pytest.TempPathFactory) -> Vessel:
    """Parameters are off by a fifth, as before an estimation."""
    return load_vessel(write_vessel(tmp_path_factory.mktemp("ship") / "ship.toml", off=1.2))


def read(folder: Path, log: Log, ship: Vessel, names: tuple[str, ...] = NAMES) -> Record:
    return measured([write_log(folder / "log.csv", log, names)], ship)


def findings(folder: Path, log: Log, ship: Vessel, names: tuple[str, ...] = NAMES) -> dict[str, Finding]:
    """By the names of their quantities."""
    record = load_records(write_log(folder / "log.csv", log, names), vessel_inputs=ship.model.inputs)
    return {finding.name: finding for finding in _disagreements(record.batches, ship, ship.model)}


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("sample_s", "count"), [(1.0, 4), (0.2, 2), *(pytest.param(s, 20, marks=pytest.mark.slow) for s in (1.0, 0.2))]
)
@pytest.mark.parametrize("kind", KINDS)
def test_clean_records_are_not_doubted(tmp_path: Path, ship: Vessel, kind: str, sample_s: float, count: int) -> None:
    for gust in (0.0, 2.0):
        for log in voyages(count, kind, sample_s=sample_s, gust=gust):
            for names in (NAMES, POSE):
                assert read(tmp_path, log, ship, names).doubts == ()


@pytest.mark.parametrize("rounding", [np.radians(1.0), np.radians(0.1)])
@pytest.mark.parametrize("kind", ["zigzag", "circle", "straight"])
def test_rounded_readings_are_not_taken_for_held_ones(tmp_path: Path, ship: Vessel, kind: str, rounding: float) -> None:
    for log in voyages(4, kind, sample_s=0.2, noise=0.05, last_s=200.0):
        log["heading_rad"] = np.round(log["heading_rad"] / rounding) * rounding
        assert read(tmp_path, log, ship, POSE).doubts == ()


def scaled(*names: str, by: float) -> Callable[[Log], Log]:
    return lambda log: {**log, **{name: by * log[name] for name in names}}


def moved(log: Log) -> Log:
    """The antenna is 15 m forward and 2 m to starboard."""
    c, s = np.cos(log["heading_rad"]), np.sin(log["heading_rad"])
    return {**log, "north_m": log["north_m"] + 15 * c - 2 * s, "east_m": log["east_m"] + 15 * s + 2 * c}


def through_water(log: Log) -> Log:
    """The log measures through water that flows at 0.4 m/s to 30 degrees."""
    to_north, to_east = 0.4 * np.cos(np.radians(30)), 0.4 * np.sin(np.radians(30))
    c, s = np.cos(log["heading_rad"]), np.sin(log["heading_rad"])
    return {
        **log,
        "u_mps": log["u_mps"] - to_north * c - to_east * s,
        "v_mps": log["v_mps"] + to_north * s - to_east * c,
    }


def later(*names: str, samples: int) -> Callable[[Log], Log]:
    return lambda log: {
        **log, **{name: np.concatenate([np.full(samples, log[name][0]), log[name][:-samples]]) for name in names}
    }  # fmt: skip


FAULTS: dict[str, tuple[Callable[[Log], Log], float]] = {
    "yaw_rate_delay_s": (later("r_radps", samples=3), 1.2),
    "yaw_rate_scale": (scaled("r_radps", by=0.95), 0.95),
    "yaw_rate_bias_radps": (lambda log: {**log, "r_radps": log["r_radps"] + 0.006}, 0.006),
    "velocity_scale": (scaled("u_mps", "v_mps", by=0.95), 0.95),
    "surge_scale": (scaled("u_mps", by=0.9), 0.9),
    "velocity_delay_s": (later("u_mps", "v_mps", samples=4), 1.6),
    "position_delay_s": (later("north_m", "east_m", samples=4), 1.6),
    "heading_bias_rad": (lambda log: {**log, "heading_rad": log["heading_rad"] + 0.14}, 0.14),
    "position_forward_m": (moved, 15.0),
    "current_mps": (through_water, 0.4),
}


def test_what_a_gyro_and_a_heading_show_of_each_other_bounds_what_a_diagnosis_may_say(
    tmp_path: Path, ship: Vessel
) -> None:
    """Delays of either, on time and late by three samples."""
    inside = 0
    for delay in (0, 3):
        for log in voyages(COUNT, "zigzag", sample_s=0.4, seed=9):
            record = read(tmp_path, later("r_radps", samples=delay)(log) if delay else log, ship)
            model = extended_model(ship, record)
            for key, sign in (("late:r", 1.0), ("late:psi", -1.0)):
                low, high = record.shown[key]
                inside += low < sign * 0.4 * delay < high
                assert high - low < 1.0
                for beyond in (max(high, 0.0) + 0.1, min(low, 0.0) - 0.1):
                    assert not model.with_effects({key: beyond}).is_possible([key])
    assert inside >= 4 * COUNT * (0.95 - 3.0 * np.sqrt(0.95 * 0.05 / (2 * COUNT)))


@pytest.mark.parametrize("kind", ["zigzag", "circle", "random", "courses"])
def test_a_late_heading_is_not_taken_for_another_place_or_another_clock(
    tmp_path: Path, ship: Vessel, kind: str
) -> None:
    for log in voyages(3, kind):
        (finding,) = findings(tmp_path, later("heading_rad", samples=3)(log), ship).values()
        assert finding.name == "yaw_rate_delay_s"
        assert finding.text.startswith("the heading comes ")
        assert abs(finding.value + 3.0) < 3.0 * finding.std


def test_a_sway_in_knots_is_named_beside_the_place_that_it_looks_like(tmp_path: Path, ship: Vessel) -> None:
    """In steady turns ships drift in proportion to how they turn."""
    for kind, number in (("zigzag", 0), ("circle", 2)):
        log = voyages(3, kind)[number]
        place = findings(tmp_path, scaled("v_mps", by=3600 / 1852)(log), ship)["position_forward_m"]
        scale, std = re.search(r"or v_mps is (\S+) ± (\S+) times the sway speed", place.text).groups()
        assert abs(float(scale) - 3600 / 1852) < 4.0 * float(std)
    assert "v_mps is" not in findings(tmp_path, moved(voyages(1, "random")[0]), ship)["position_forward_m"].text


@pytest.mark.parametrize("noise_mps", [0.0, 0.03, 0.06])
@pytest.mark.parametrize("scale", [1.0, 0.87, 1.15])
def test_noise_of_a_sway_that_follows_the_turn_is_not_taken_for_its_scale(scale: float, noise_mps: float) -> None:
    """Beside an antenna's place only the beginnings of turns tell that scale; regression makes it small by noise."""
    told = []
    for seed in range(3):
        rng, t = np.random.default_rng(seed), np.arange(10_800.0)
        turn, r, v = np.repeat(rng.choice([-0.02, -0.01, 0.0, 0.01, 0.02], 90), 120), np.zeros_like(t), np.zeros_like(t)
        for k in range(len(t) - 1):
            r[k + 1] = r[k] + (turn[k] - r[k]) / 5.0
            v[k + 1] = v[k] + (-20.0 * r[k] - v[k]) / 5.0
        heading = np.concatenate([[0.0], np.cumsum((r[1:] + r[:-1]) / 2.0)])
        way = (6.5 + 1j * v) * np.exp(1j * heading)
        place = np.concatenate([[0.0], np.cumsum((way[1:] + way[:-1]) / 2.0)])
        seen = np.column_stack([np.full_like(t, 6.5), scale * v, r])
        seen[:, :2] += noise_mps * rng.standard_normal((len(t), 2))
        at = np.column_stack([place.real, place.imag]) + 0.05 * rng.standard_normal((len(t), 2))
        batch = Batch(
            name="log", sample_time_s=1.0, input_names=(), inputs=np.zeros((len(t), 0)), velocity=seen,
            pose=np.column_stack([at, heading]),
        )  # fmt: skip
        told += list(log_against_positions([batch], length_m=60.0))
    assert {finding.name for finding in told} <= ({"sway_scale"} if scale != 1.0 else set())
    assert all(abs(finding.value - scale) < 4.0 * finding.std for finding in told)
    assert noise_mps or scale == 1.0 or len(told) == 3


ALIKE_IN_A_CIRCLE = "surge_scale", "velocity_delay_s", "position_delay_s"
"""In a steady turn axes, clocks and places look alike."""


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        (name, kind)
        for name in FAULTS
        for kind in ("zigzag", "random", "circle")
        if kind != "circle" or name not in ALIKE_IN_A_CIRCLE
    ],
)
def test_a_fault_is_named_with_its_size(tmp_path: Path, ship: Vessel, name: str, kind: str) -> None:
    spoil, truth = FAULTS[name]
    errors = []
    for log in first_voyages(kind, sample_s=0.4, seed=1):
        found = findings(tmp_path, spoil(log), ship)
        assert set(found) == {name}
        errors.append((found[name].value - truth) / found[name].std)
    # jackknife errors of a dozen stretches have about the tails of t with ten degrees of freedom, std 1.12
    assert np.sum(np.square(errors)) < 1.12**2 * chi2.isf(3e-4, len(errors))
    assert abs(np.mean(errors)) < 1.12 * 4.0 / np.sqrt(COUNT)


@pytest.mark.parametrize("kind", ["random", "straight", "zigzag"])
def test_a_log_wrong_ahead_alone_is_told_from_one_wrong_in_both_axes_or_both_are_named(
    tmp_path: Path, ship: Vessel, kind: str
) -> None:
    """In 200 s she drifts little: the likelier of both is first, the other left out only where it is wrong."""
    first, errors = [], []
    for truth, columns in (("surge_scale", ("u_mps",)), ("velocity_scale", ("u_mps", "v_mps"))):
        for log in first_voyages(kind, sample_s=0.4, seed=5, last_s=200.0):
            (found,) = findings(tmp_path, scaled(*columns, by=0.95)(log), ship).values()
            first.append(found.name == truth)
            assert first[-1] or "sway is too little to tell" in found.text
            errors.append((found.value - 0.95) / found.std)
    assert np.mean(first) > 0.9 - 3.0 * np.sqrt(0.9 * 0.1 / len(first))
    assert np.sum(np.square(errors)) < 1.12**2 * chi2.isf(3e-4, len(errors))


@pytest.mark.parametrize(
    "name", ["yaw_rate_scale", "yaw_rate_bias_radps", "velocity_scale", "surge_scale", "velocity_delay_s"]
)
def test_what_two_instruments_show_of_a_third_is_undone(tmp_path: Path, ship: Vessel, name: str) -> None:
    for log in voyages(4, "random", sample_s=0.4, seed=3):
        spoiled = FAULTS[name][0](log)
        clean, found = (read(tmp_path, one, ship) for one in (log, spoiled))
        assert len(found.faults) == 1
        assert found.faults[0].endswith(("divided by that.", "that is taken off.", "moved to their own time."))
        (own,), (mended,) = clean.batches, found.batches
        (as_read,) = load_records(
            write_log(tmp_path / "log.csv", spoiled, NAMES), vessel_inputs=ship.model.inputs
        ).batches
        (watched,) = measured([tmp_path / "log.csv"], ship, undo=False).batches  # its change would be an alarm
        assert np.array_equal(watched.velocity, as_read.velocity, equal_nan=True)
        blocks = len(mended) // 10  # means over 4 s, as white noise of the log is not the question
        left, lost = (
            (one.velocity[: 10 * blocks] - own.velocity[: 10 * blocks]).reshape(blocks, 10, 3).mean(axis=1)
            for one in (mended, as_read)
        )
        assert np.sqrt(np.nanmean(left**2)) < 0.5 * np.sqrt(np.nanmean(lost**2))


def test_velocities_that_come_late_are_told_apart_from_a_place_by_speeds_that_differ(
    tmp_path: Path, ship: Vessel
) -> None:
    for log in voyages(4, "random", sample_s=0.2, seed=2):
        slow = 0.85 + 0.15 * np.sin(2 * np.pi * log["time_s"] / 90.0)
        pose = [log["north_m"][0], log["east_m"][0]]
        c, s = np.cos(log["heading_rad"]), np.sin(log["heading_rad"])
        u, v = slow * log["u_mps"], slow * log["v_mps"]
        for axis, rate in enumerate((c * u - s * v, s * u + c * v)):
            log[("north_m", "east_m")[axis]] = pose[axis] + np.cumsum(rate) * 0.2
        log["u_mps"], log["v_mps"] = (np.concatenate([np.full(4, one[0]), one[:-4]]) for one in (u, v))
        found = findings(tmp_path, log, ship)
        assert set(found) == {"velocity_delay_s"}
        assert found["velocity_delay_s"].value == pytest.approx(0.8, abs=0.15)  # half a sample by the sum


@pytest.mark.parametrize("level", [0.0123, -0.00071, 1.0 / 3.0])
@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_a_reading_that_never_moves_has_no_ratio_to_others(level: float, noise: float) -> None:
    rng = np.random.default_rng(3)
    x, z = rng.standard_normal((2, 40, 30))
    y = level + noise * rng.standard_normal((40, 30))
    found = relation([np.column_stack(rows) for rows in zip(y, x, np.ones_like(x), z, strict=True)])
    assert (found is None) == (noise == 0.0)
    assert found is None or np.isfinite([found.size, found.size_std]).all()


@pytest.mark.parametrize("names", [NAMES, POSE])
@pytest.mark.parametrize("kind", ["zigzag", "random", "circle"])
def test_a_ship_that_turns_against_her_rudder_is_told(
    tmp_path: Path, ship: Vessel, kind: str, names: tuple[str, ...]
) -> None:
    for log in first_voyages(kind, gust=0.5):
        log["rudder1_rad"] = -log["rudder1_rad"]
        (doubt,) = read(tmp_path, log, ship, names).doubts
        assert doubt.startswith("log.csv: the ship turns against the rudder: ")
        assert "Is rudder1 positive to port, or a sign wrong in [model.parameters]?" in doubt


@pytest.mark.parametrize("kind", ["zigzag", "random"])
def test_radians_under_the_name_of_degrees_are_told(tmp_path: Path, ship: Vessel, kind: str) -> None:
    for log in first_voyages(kind, gust=0.5):
        log["rudder1_rad"] = np.radians(log["rudder1_rad"])
        (doubt,) = read(tmp_path, log, ship).doubts
        assert doubt.endswith("times with rudder1 57.3 times as large: radians under the name of degrees?")


@pytest.mark.parametrize("sample_s", [0.05, 0.5])
def test_an_even_movement_faster_than_stated_is_a_position_at_another_rate(sample_s: float) -> None:
    """Not so orders, which jump, a helmsman's, who turns the wheel as he likes, and movements at the stated rate."""
    rng, time = np.random.default_rng(0), np.arange(0.0, 300.0, sample_s)
    order = 0.35 * np.sign(np.sin(2 * np.pi * time / 40.0))
    slewed = np.zeros_like(order)
    for k in range(1, len(order)):
        slewed[k] = slewed[k - 1] + np.clip(order[k] - slewed[k - 1], -0.15 * sample_s, 0.15 * sample_s)
    slewed += 0.0005 * rng.standard_normal(len(time))
    helmsman = 0.35 * np.sin(2 * np.pi * time / 9.0) * np.sin(2 * np.pi * time / 40.0)
    limit = Limit(low=-0.6, high=0.6)

    def found(signal: np.ndarray, rate: float) -> list[Finding]:
        batch = Batch(
            name="run", sample_time_s=sample_s, input_names=("rudder1",), inputs=signal[:, None],
            velocity=np.zeros((len(time), 3)),
        )  # fmt: skip
        own = Actuator(kind="rudder", number=1, limits=(limit,), responses=(Response(rate=rate),))
        return list(faster_than_stated([batch], [own]))

    (told,) = found(slewed, 0.04)
    assert told.value == pytest.approx(0.15, rel=0.02)
    assert "name it reached_rudder1_rad" in told.text
    for signal, rate in ((slewed, 0.15), (order, 0.04), (helmsman, 0.04), (slewed, np.inf)):
        assert found(signal, rate) == []


def test_the_rudder_sign_is_the_vessel_files_and_no_convention(tmp_path: Path) -> None:
    text = write_vessel(tmp_path / "ship.toml").read_text().replace("N_ud = 0.0005\n", "N_ud = -0.0005\n")
    (tmp_path / "ship.toml").write_text(text)
    port = load_vessel(tmp_path / "ship.toml")
    for log in first_voyages("zigzag", gust=0.5):
        assert "against the rudder" in read(tmp_path, log, port).doubts[0]
        log["rudder1_rad"] = -log["rudder1_rad"]
        assert read(tmp_path, log, port).doubts == ()


@pytest.mark.parametrize("names", [NAMES, POSE])
@pytest.mark.parametrize("kind", ["random", "circle"])
@pytest.mark.parametrize(("axis", "scale"), [("north_m", 1 / 0.3048), ("east_m", 1 / 0.3048), ("east_m", 2.0)])
def test_an_axis_of_positions_in_another_unit_is_named_and_no_log_is_mended_by_it(
    tmp_path: Path, ship: Vessel, axis: str, scale: float, kind: str, names: tuple[str, ...]
) -> None:
    """Velocities that were right were divided by 0.37; from positions alone nothing was said."""
    ratio, told = scale if axis == "east_m" else 1 / scale, 0
    for log in voyages(4, kind, gust=0.5):
        log[axis] = scale * log[axis]
        found = findings(tmp_path, log, ship, names).get("position_axes")
        if found is None:
            continue
        told += 1
        assert abs(found.value / ratio - 1.0) < 0.15
        record = read(tmp_path, log, ship, names)
        assert record.doubts[0].startswith("log.csv: positions move")
        assert not any("Here it is" in text or "Here that is" in text for text in record.doubts)
    assert told == 4 if kind == "circle" else told >= 2  # a random track may bend too little to tell


@pytest.mark.parametrize("names", [NAMES, POSE])
@pytest.mark.parametrize("kind", ["zigzag", "random", "circle"])
def test_course_taken_for_heading_is_recognised(
    tmp_path: Path, ship: Vessel, kind: str, names: tuple[str, ...]
) -> None:
    for seed, log in enumerate(first_voyages(kind, gust=0.5)):
        drift = np.arctan2(log["v_mps"], log["u_mps"])
        noise = 0.005 * np.random.default_rng(seed).standard_normal(len(drift))
        log["heading_rad"] = log["heading_rad"] + drift + noise
        assert "log.csv: the heading column holds course over ground" in " ".join(
            read(tmp_path, log, ship, names).doubts
        )


@pytest.mark.parametrize("kind", ["zigzag", "random", "circle", "courses"])
def test_headings_that_count_counter_clockwise_are_refused(tmp_path: Path, ship: Vessel, kind: str) -> None:
    for log in first_voyages(kind):
        truth = log["heading_rad"]
        for heading, whence in ((np.pi / 2 - truth, " from east, as in mathematics"), (-truth, "")):
            log["heading_rad"] = heading
            with pytest.raises(
                FileError, match=f"heading_rad: counts counter-clockwise{whence}, as the positions show"
            ) as caught:
                read(tmp_path, log, ship, POSE)
            # north for east is the same mistake
            assert ("north_m and east_m are exchanged" in str(caught.value)) == bool(whence)


FIELD = {
    "heading/cog.csv": "the heading column holds course over ground",
    "heading/held.csv": "the headings are read every 5 s",
    "rudder-sign/zz20-act-port.csv": "the ship turns against the rudder",
    "rudder-sign/tc35-act-port.csv": "the ship turns against the rudder",
    "rudder-rate/zz20.csv": "",
    "rudder-rate/tc35.csv": "",
}


@pytest.mark.outside
@pytest.mark.parametrize("name", FIELD)
def test_inputs_of_the_field_are_told_by_name(name: str) -> None:
    ship = load_vessel(outside("field/rudder-rate/ship8.toml"))
    doubts = measured([outside(f"field/{name}")], ship).doubts
    assert FIELD[name] in " ".join(doubts)
    assert len(doubts) == bool(FIELD[name])


@pytest.mark.outside
def test_the_positions_of_every_pond_run_come_early_by_the_same_time() -> None:
    delays = []
    for batch in outside_record("esso-osaka-3m", ("random", "turn_1", "zigzag")).batches:
        found = {finding.name: finding for finding in log_against_positions([batch], length_m=3.0)}
        delays.append(-found["position_delay_s"].value)
    assert np.ptp(delays) < 0.1
    assert np.median(delays) == pytest.approx(0.96, abs=0.01)


@pytest.mark.outside
def test_tank_records_are_not_doubted() -> None:
    ship = load_vessel(outside("field/crash/vessel.toml"))
    for path in sorted(outside("kvlcc2-hsva-7m").glob("*.csv")):
        assert measured([path], ship).doubts == ()


@pytest.mark.parametrize("name", ["velocity_scale", "surge_scale", "yaw_rate_scale", "yaw_rate_bias_radps"])
def test_a_fault_that_the_vessel_file_states_is_not_told_again(tmp_path: Path, ship: Vessel, name: str) -> None:
    spoil, truth = FAULTS[name]
    (log,) = voyages(1, "random", sample_s=0.4, seed=3)
    stating = replace(ship, sensors=replace(ship.sensors, **{name: truth}))
    assert len(read(tmp_path, spoil(log), ship).faults) == 1
    assert read(tmp_path, spoil(log), stating).faults == ()
