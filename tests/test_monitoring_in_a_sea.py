"""Monitoring on autopilot in a slight sea: nothing false of an unchanged ship; surge is watched whatever yaw does."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.diagnosis import diagnose
from expdesign.diagnosis.data import has_wind
from expdesign.diagnosis.motion import stable_windows
from expdesign.diagnosis.select import Suspected, suspected_tests
from expdesign.diagnosis.vessel_file import extended_model
from expdesign.export.monitor_content import said_of_reference
from expdesign.monitoring import (
    WHITE,
    Alarm,
    Calibration,
    Grams,
    Noise,
    Rules,
    State,
    calibrate,
    grams_and_noise,
    grams_of,
    later_part,
    stretch_length,
    threshold,
    watch,
    watched_changes,
    watched_ship,
)
from expdesign.monitoring.evidence import STARTS
from expdesign.monitoring.noise import whitened
from expdesign.saved import restored, saved
from expdesign.scenario import load_vessel
from expdesign.signals import Batch, Record
from expdesign.vessel import Vessel
from expdesign.workflows.commands.diagnose import with_alarms
from sea_case import CALM, CASES, FRESH, HOUR, OTHER_SEAS, WINDS, Sea, Ship, relative_wind, sailed, vessel_file, written

PUSHED = Sea(pushed_s=5.0)
STEPS = 14


@pytest.fixture(scope="module")
def vessel(tmp_path_factory: pytest.TempPathFactory) -> Vessel:
    return load_vessel(vessel_file(tmp_path_factory.mktemp("ship") / "vessel.toml"))


def as_record(vessel: Vessel, table: np.ndarray) -> Record:
    batch = Batch(
        name="voyage", sample_time_s=table[1, 0] - table[0, 0], input_names=vessel.model.inputs, inputs=table[:, 7:9],
        velocity=table[:, 4:7], pose=table[:, 1:4], wind=relative_wind(table),
    )  # fmt: skip
    return Record(batches=(batch,), notes=())


def stretches(vessel: Vessel, table: np.ndarray, *, known: Noise | None = None, noise: Noise | None = None):
    """Changes that are watched for, the noise and the inner products of a voyage."""
    record = as_record(vessel, table)
    ship = watched_ship(vessel, record)
    changes, words = (
        watched_changes(ship, wind=has_wind(record)),
        {"begins_s": [0.0], "stretch_s": stretch_length(vessel.length_m)},
    )
    if noise is not None:
        return changes, noise, grams_of(ship, record, changes, noise=noise, **words)
    grams, noise = grams_and_noise(ship, record, changes, known=known, **words)
    return changes, noise, grams


@pytest.fixture(scope="module")
def known(vessel: Vessel) -> tuple[Noise, Calibration]:
    """Of four hours in which waves push the ship in yaw."""
    _, noise, grams = stretches(vessel, sailed([Ship()], 4 * HOUR, seeds=[5000], sea=PUSHED)[0])
    return noise, calibrate(grams)


def alarms_of(vessel: Vessel, known: tuple[Noise, Calibration], table: np.ndarray) -> tuple[State, list[str]]:
    """The state up to the first change that is settled, and the effects that were named."""
    changes, _, grams = stretches(vessel, table, known=known[0])
    rules = Rules(limit=threshold(int(known[1].watched.sum()), 30 * 24 * HOUR / grams.stretch_s))
    state, alarms, _, _ = watch(known[1], State.begun(known[1], time_s=0.0), grams, rules=rules)
    found: list[Alarm] = [*alarms, *([] if state.alarm is None else [state.alarm])]
    return state, [changes[found[-1].change].effect] if found else []


def test_the_filtered_columns_have_the_inner_products_of_generalised_least_squares() -> None:
    rng = np.random.default_rng(0)
    noise = Noise(
        std=np.array([0.3, 0.4, 0.5, 0.7]), pushes=np.array([0.2, 0.1, 0.3]), waves=np.array([0.5, 0.0, 0.4]),
        period_s=6.0, kept=0.8,
    )  # fmt: skip
    transition = np.eye(3) * 0.8 + 0.1 * rng.standard_normal((1, STEPS - 1, 3, 3))
    columns = rng.standard_normal((2, 1, STEPS, 4))
    seen = rng.random((1, STEPS, 4)) < 0.8
    columns = np.where(seen, columns, 0.0)
    shown = np.zeros((4, 7))
    shown[[0, 1, 2, 3], [0, 1, 2, 2]] = 1.0
    shown[[0, 2, 3], [3, 5, 5]] = 1.0
    fresh = np.diag([0.2, 0.1, 0.3, *[0.5 * (1 - 0.8**2)] * 2, *[0.4 * (1 - 0.8**2)] * 2])
    before = np.diag([0.0, 0.0, 0.0, 0.5, 0.5, 0.4, 0.4])
    over = np.zeros((STEPS * 7, STEPS * 7))  # covariance of the states at all steps
    over[:7, :7] = before
    for step in range(1, STEPS):
        moving = np.zeros((7, 7))
        moving[:3, :3] = transition[0, step - 1]
        for own in (slice(3, 5), slice(5, 7)):
            moving[own, own] = noise.wave_transition(1.0)
        last, now = slice(7 * step - 7, 7 * step), slice(7 * step, 7 * step + 7)
        over[now, : 7 * step] = moving @ over[last, : 7 * step]
        over[: 7 * step, now] = over[now, : 7 * step].T
        over[now, now] = moving @ over[last, last] @ moving.T + fresh
    C = np.kron(np.eye(STEPS), shown)
    R = (C @ over @ C.T + np.kron(np.eye(STEPS), np.diag(noise.std**2)))[np.ix_(seen.ravel(), seen.ravel())]
    flat = columns.reshape(2, -1)[:, seen.ravel()]
    told = (whitened(columns, seen, transition, noise, step_s=1.0) / noise.std).reshape(2, -1)
    assert told @ told.T == pytest.approx(flat @ np.linalg.solve(R, flat.T))
    assert whitened(columns, seen, transition, WHITE, step_s=1.0) is columns


@pytest.mark.thorough
def test_the_noise_is_that_of_the_sea(vessel: Vessel) -> None:
    voyages = [sailed([Ship()], 2 * HOUR, seeds=[3], sea=sea)[0] for sea in (CALM, Sea(), PUSHED)]
    calm, waves, pushed = (stretches(vessel, table)[1] for table in voyages)
    assert calm.white
    assert calm.std[:3] == pytest.approx([0.02, 0.02, Sea().gyro_radps], rel=0.1)
    assert not waves.pushes.any()
    assert waves.period_s == pytest.approx(Sea().period_s, rel=0.1)
    assert np.sqrt(waves.waves) == pytest.approx([0.04, 0.08, Sea().wave_radps], rel=0.25)
    assert pushed.pushes[2] > 100 * pushed.pushes[:2].max() * 1e-6
    assert np.sqrt(pushed.waves[2]) < 0.1 * Sea().wave_radps
    again = stretches(vessel, voyages[1], known=waves)[1]
    assert again is waves
    assert stretches(vessel, voyages[2], known=waves)[1].pushes[2] > 0.0  # another sea is learnt anew


@pytest.mark.thorough
def test_scores_of_an_unchanged_ship_are_unbiased_where_the_rudder_answers_the_sea(vessel: Vessel) -> None:
    seeds, far = range(3), {True: [], False: []}
    for table in sailed([Ship()] * len(seeds), 2 * HOUR, seeds=seeds, sea=PUSHED):
        for modelled, values in far.items():
            changes, _, grams = stretches(vessel, table, noise=None if modelled else WHITE)
            told = calibrate(grams)
            places = [k for k, change in enumerate(changes) if change.effect in ("theta:Y_ur", "inertia:r")]
            values.append((told.baseline / told.baseline_std * np.sqrt(told.inflation))[places])
    bias = {modelled: np.abs(np.mean(values, axis=0)).max() for modelled, values in far.items()}
    assert bias[True] < 3.0 / np.sqrt(len(seeds))
    assert bias[False] > 3.0 / np.sqrt(len(seeds))


@pytest.mark.thorough
def test_drag_is_found_within_an_hour_and_nothing_in_an_unchanged_ship(
    vessel: Vessel, known: tuple[Noise, Calibration]
) -> None:
    ships = [Ship(), CASES["drag + 15 %"]]
    same, changed = sailed(ships, 2 * HOUR, seeds=[6, 7], sea=PUSHED, since_s=HOUR)
    assert alarms_of(vessel, known, same)[1] == []
    assert alarms_of(vessel, known, changed)[1][0] in ("theta:X_uu", "theta:X_nn", "gain")


@pytest.mark.thorough
def test_a_gyro_that_tells_too_little_is_found_by_the_compass_within_an_hour(
    vessel: Vessel, known: tuple[Noise, Calibration]
) -> None:
    (table,) = sailed([CASES["yaw rate times 0.97"]], 2 * HOUR, seeds=[9], sea=PUSHED, since_s=HOUR)
    assert alarms_of(vessel, known, table)[1] == ["gyro"]


@pytest.mark.thorough
def test_a_wind_as_in_the_reference_that_she_turns_in_is_no_change_of_hers(vessel: Vessel) -> None:
    assert false_in(vessel, Sea(wind=FRESH), [73000, 73030], hours=1) == []


@pytest.mark.thorough
@pytest.mark.parametrize("wind", ["twice as strong", "turning by 120 degrees in 20 min"])
def test_another_wind_than_the_references_is_no_change_of_the_ship(vessel: Vessel, wind: str) -> None:
    """Nor is one that she meets in the whole of a voyage: along her axes it goes with her heading."""
    assert false_in(vessel, Sea(wind=FRESH), [77000, 77060], hours=2, later=Sea(wind=WINDS[wind])) == []


@pytest.mark.thorough
def test_less_thrust_than_the_size_that_matters_is_found_where_a_slow_force_hides_a_third_of_it(vessel: Vessel) -> None:
    """A sum that grows fastest for the whole size does not grow at all for a half of it."""
    (before,) = sailed([Ship()], 4 * HOUR, seeds=[74070])
    (after,) = sailed([CASES["thrust - 8 %"]], 2 * HOUR, seeds=[74072], since_s=HOUR)
    _, noise, grams = stretches(vessel, before)
    assert alarms_of(vessel, (noise, calibrate(grams)), after)[1] in (["theta:X_nn"], ["gain"])


@pytest.mark.thorough
def test_a_disturbance_in_yaw_beyond_the_reference_does_not_stop_surge(
    vessel: Vessel, known: tuple[Noise, Calibration]
) -> None:
    quick = Sea(pushed_s=5.0, wave_radps=np.deg2rad(0.25))
    slow = Sea(pushed_s=5.0, yaw_radps2=3.0 * PUSHED.yaw_radps2)
    for sea in (quick, slow):
        (table,) = sailed([CASES["drag + 15 %"]], 2 * HOUR, seeds=[8], sea=sea, since_s=HOUR)
        state, names = alarms_of(vessel, known, table)
        assert names[:1] in (["theta:X_uu"], ["theta:X_nn"], ["gain"])
        assert state.left_out_s < 0.2 * state.judged_s


@pytest.mark.thorough
def test_wind_that_turns_her_is_named_beside_the_change_that_it_looks_like(
    vessel: Vessel, known: tuple[Noise, Calibration]
) -> None:
    """At a steady speed a moment of the wind is an offset of the rudder, and nothing in surge or sway is either."""
    (table,) = sailed([Ship(push_radps2=3e-4)], HOUR, seeds=[12], sea=PUSHED)
    changes, noise, grams = stretches(vessel, table, known=known[0])
    record = as_record(vessel, table)
    ship = extended_model(vessel, record)

    def again(shift: np.ndarray, since_s: float) -> Grams:
        changed = ship.with_effects({c.effect: c.size * x for c, x in zip(changes, shift.tolist(), strict=True) if x})
        part, begins_s = later_part(record, [0.0], since_s, grams.stretch_s)
        return grams_of(changed, part, changes, begins_s=begins_s, stretch_s=grams.stretch_s, noise=noise)

    rules = Rules(limit=threshold(int(known[1].watched.sum()), 30 * 24 * HOUR / grams.stretch_s))
    state, _, _, _ = watch(known[1], State.begun(known[1], time_s=0.0), grams, rules=rules, again=again)
    assert state.alarm is not None
    assert changes[state.alarm.change].effect == "offset:rudder"
    assert [axis for axis, _ in state.alarm.pushes] == [2]
    assert restored(Alarm, json.loads(json.dumps(saved(state.alarm)))) == state.alarm


@pytest.mark.slow
def test_what_slow_forces_hide_within_stretches_inflates_no_score(vessel: Vessel) -> None:
    """A force that lasts ten minutes grows within a stretch: without that, scores scatter by half as much again."""
    ratios = dict[bool, list[float]]({True: [], False: []})
    for table in sailed([Ship()] * 2, 3 * HOUR, seeds=[5000, 5010], sea=PUSHED):
        changes, _, grams = stretches(vessel, table)
        place = [change.effect for change in changes].index("gain")
        first = grams.changes + STARTS
        kept = np.r_[:first, first + grams.ramps : grams.products.shape[-1]]
        steady = replace(grams, products=grams.products[:, :, kept][..., kept], ramps=0)
        for ramps, own in ((True, grams), (False, steady)):
            ratios[ramps].append(float(calibrate(own).inflation[place]))
    each = np.divide(ratios[True], ratios[False])
    assert each.max() < 0.8, ratios  # of the same stretches, so that chance is common to both


def false_in(vessel: Vessel, sea: Sea, seeds: Sequence[int], *, hours: int = 2, later: Sea | None = None) -> list[str]:
    """What is named falsely of unchanged ships in so many hours, or said of their references of twice as many."""
    both = ((2 * hours, sea), (hours, later or sea))
    voyages = [sailed([Ship()] * len(seeds), length * HOUR, seeds=seeds, sea=one) for length, one in both]
    false = list[str]()
    for seed, before, after in zip(seeds, *voyages, strict=True):
        changes, noise, grams = stretches(vessel, before)
        known = noise, calibrate(grams, changes=changes)
        false += [f"{seed}: {changes[k].effect} of the reference" for k in np.flatnonzero(said_of_reference(known[1]))]
        false += [f"{seed}: {name}" for name in alarms_of(vessel, known, after)[1]]
    return false


@pytest.mark.thorough
def test_nothing_false_is_said_of_an_unchanged_ship_in_a_quartering_sea(vessel: Vessel) -> None:
    assert false_in(vessel, OTHER_SEAS["quartering"], [1], hours=1) == []


@pytest.mark.slow
@pytest.mark.parametrize("sea", OTHER_SEAS)
def test_nothing_false_is_said_of_unchanged_ships_in_other_seas(vessel: Vessel, sea: str) -> None:
    """In 20 voyages, at one false alarm in 30 days: two hours each are 1.7 days."""
    assert false_in(vessel, OTHER_SEAS[sea], range(9000, 9020)) == []


@pytest.mark.thorough
def test_shallower_water_than_the_references_is_told_and_not_judged(tmp_path: Path) -> None:
    path = vessel_file(tmp_path / "vessel.toml")
    deep, shoal = (
        written(tmp_path / name, table)
        for name, table in zip(
            ("deep.csv", "shoal.csv"), sailed([Ship(), Ship(drag=1.4, mass=1.2)], 2 * HOUR, seeds=[1, 2]), strict=True
        )
    )
    for file, depth in ((deep, 60.0), (shoal, 6.0)):
        header, *rows = file.read_text().splitlines()
        file.write_text("\n".join([f"{header},depth_m", *(f"{row},{depth}" for row in rows)]) + "\n")
    words = ["monitor", str(shoal), "--reference", str(deep), "--vessel", str(path), "--out", str(tmp_path), "--quiet"]
    assert main(words) == 0
    told = json.loads((tmp_path / "monitor.json").read_text())
    assert told["alarms"] == []
    assert told["judged_h"] == 0.0
    assert "the measured depth_m is less than in the reference, draught over depth up to 0.50" in told["verdict"][0]
    assert not any("the ship is the one of the reference" in sentence for sentence in told["verdict"])


@pytest.mark.thorough
def test_a_gyro_is_named_as_a_sensor_and_not_as_the_ship(tmp_path: Path) -> None:
    path = vessel_file(tmp_path / "vessel.toml")
    words = {"reference": (Ship(), 4 * HOUR, 0, 81000), "voyage": (CASES["yaw rate times 0.97"], 2 * HOUR, HOUR, 81001)}
    known, voyage = (
        written(tmp_path / f"{name}.csv", sailed([ship], seconds, seeds=[seed], since_s=since_s)[0])
        for name, (ship, seconds, since_s, seed) in words.items()
    )
    asked = ["monitor", str(voyage), "--reference", str(known), "--vessel", str(path), "--out", str(tmp_path), "-q"]
    assert main(asked) == 0
    verdict = json.loads((tmp_path / "monitor.json").read_text())["verdict"]
    assert any("a sensor has changed: scale of yaw rate by" in sentence for sentence in verdict)
    assert not any("the ship has changed" in sentence for sentence in verdict)


def test_a_diagnosis_takes_over_what_the_alarm_named(vessel: Vessel, tmp_path: Path) -> None:
    alarm = {"effect": "theta:X_uu", "value": -0.0006, "std": 0.0008, "in_words": "parameter X_uu by +15 ± 20 %"}
    (tmp_path / "monitor.json").write_text(json.dumps({"alarms": [alarm]}))
    ship, named = with_alarms(vessel, [tmp_path / "since-change.csv"])
    place = vessel.model.names.index("X_uu")
    assert ship.model.parameter_std[place] == pytest.approx(0.001)
    assert np.delete(ship.model.parameter_std, place) == pytest.approx(np.delete(vessel.model.parameter_std, place))
    assert [*named] == ["theta:X_uu"]
    assert alarm["in_words"] in named["theta:X_uu"]
    assert with_alarms(vessel, [tmp_path / "other.csv"])[1] == {}
    for effect, key in (("gyro", "yaw_rate_scale"), ("offset:rudder", "rudder1_offset")):
        alarm = {"effect": effect, "value": -0.04, "std": 0.03, "in_words": "by so much"}
        (tmp_path / "monitor.json").write_text(json.dumps({"alarms": [alarm]}))
        for known, taken in ((0.001, 0.05), (0.2, 0.2)):
            ship, named = with_alarms(replace(vessel, std={key: known}), [tmp_path / "since-change.csv"])
            assert ship.std == {key: pytest.approx(taken)}
            assert (f"deviation of {key} is taken as 0.05" in named[effect]) == (known < taken)
        assert with_alarms(vessel, [tmp_path / "since-change.csv"])[0].std == {}  # known exactly, or any size is free
    (tmp_path / "monitor.json").write_text(json.dumps({"alarms": [alarm | {"effect": "yaw:I_r"}]}))
    assert with_alarms(vessel, [tmp_path / "since-change.csv"])[1] == {}


def test_sizes_of_what_an_alarm_named_are_told_as_the_watch_tells_them() -> None:
    drag = Suspected(effect="theta:X_uu", value=-5.7e-4, std=1.6e-5, p_value=1e-4, whole=-0.004)
    assert "X_uu by -0.00057 ± 1.6e-05 (14.25 ± 0.40 %)," in drag.in_words
    rudder = Suspected(effect="offset:rudder", value=0.03534, std=0.00038, p_value=1e-4)
    assert "rudder by 0.03534 ± 0.00038 rad (2.025 ± 0.022 degrees)," in rudder.in_words
    assert "(" not in Suspected(effect="gain", value=-0.1, std=0.01, p_value=1e-4).in_words


@pytest.mark.thorough
@pytest.mark.parametrize("effect", ["gain", "theta:N_ur"])
def test_a_verdict_begins_with_what_an_alarm_named_where_the_data_show_it(vessel: Vessel, effect: str) -> None:
    """Also where the uncertain parameters of the file explain it, so that nothing is found beside them."""
    still = replace(CALM, surge_mps2=2e-4, yaw_radps2=2e-6)
    (weaker,) = sailed([Ship(thrust=0.9)], HOUR // 4, seeds=[1], sea=still)
    found = diagnose(vessel, as_record(vessel, weaker), suspected={effect: "It was named"})
    shown = effect == "gain"
    finding = found.findings[0].keys == (effect,) if found.findings else False
    assert (
        found.verdict.startswith("It was named; tested first and alone, the data show it: gain by -0.1") or finding
    ) == shown
    assert "These data show no error" not in found.verdict or not shown
    assert any(note.startswith("It was named; ") for note in found.notes) == (finding or not shown)


def test_what_an_alarm_named_is_tested_first_and_alone(vessel: Vessel) -> None:
    """The right effect is shown at its size, and one that does nothing is not: one question among no others."""
    still = replace(CALM, surge_mps2=2e-4, yaw_radps2=2e-6)
    weaker, same = sailed([Ship(thrust=0.9), Ship()], HOUR // 4, seeds=[1, 2], sea=still)
    told = dict[bool, Suspected]()
    for changed, table in ((True, weaker), (False, same)):
        record = as_record(vessel, table)
        ship = extended_model(vessel, record)
        (told[changed],) = suspected_tests(ship, stable_windows(ship, record), ["gain"])
    assert told[True].confirmed
    assert abs(told[True].value + 0.1) < 0.02
    assert "tested first and alone, the data show it: gain" in told[True].in_words
    assert told[False].p_value > 1e-3
    assert abs(told[False].value) < 0.02
    assert suspected_tests(ship, stable_windows(ship, record), []) == ()
