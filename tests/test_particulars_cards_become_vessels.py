"""`expdesign nominal`: stated trials are fitted, intervals hold, contradictions are named, wrong cards are refused."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from expdesign.cli import main
from expdesign.export.files import vessel_toml
from expdesign.export.nominal_page import BY_PROPELLERS, nominal_notes
from expdesign.indices import standard_results
from expdesign.particulars import FACTORS, SCATTER, Card, Hull, Rudder, Stated, Thruster, Trial, assumed, nominal
from expdesign.particulars.fit import Problem, fitted
from expdesign.particulars.forces import propellers
from expdesign.particulars.model import SAMPLES, STEERING, with_scatter
from expdesign.particulars.trials import Fleet
from expdesign.scenario import load_card, load_vessel
from expdesign.scenario.card_file import RudderTable, ThrusterTable
from expdesign.simulation import Helm
from scenario_files import SCENARIOS

pytestmark = pytest.mark.usefixtures("undrawn")

CARDS = SCENARIOS / "cards"
SHIPS = Path(__file__).parent / "benchmarks" / "ships"
COASTER = Card(
    name="coaster",
    hull=Hull(length_m=80.0, beam_m=13.0, draught_m=5.0, mass_kg=0.7 * 1025 * 80 * 13 * 5.0),
    thrusters=(Thruster(kind="propeller", forward_m=-38.0, diameter_m=3.0, max_rps=3.4, full_order_s=34.0),),
    rudders=(Rudder(area_m2=8.0, forward_m=-40.0),),
    top_speed_mps=6.7,
)
CIRCLE = Trial(kind="circle", speed_mps=6.0, angle_rad=math.radians(35.0))
ZIGZAG = Trial(kind="zigzag", speed_mps=6.0, angle_rad=math.radians(20.0))
SPEEDS = tuple(Trial(kind="speed", order=order) for order in (0.5, 1.0))


def values_of(
    problem: Problem,
    unknowns: np.ndarray,
    rng: np.random.Generator | None,
    trials: tuple[Trial, ...] = (*SPEEDS, CIRCLE, ZIGZAG),
) -> tuple[Stated, ...]:
    """What a card of the ship with these factors would state, with the scatter of trials."""
    fleet = Fleet(problem.ship, problem.parameters(unknowns)[None], fastest_mps=30.0)
    found = []
    for trial in trials:
        for quantity, value in fleet.results(trial).items():
            noise = 0.0 if rng is None else SCATTER[quantity] * rng.standard_normal()
            found.append(
                Stated(trial=trial, quantity=quantity, value=float(value[0]) * math.exp(noise), source=quantity)
            )
    return tuple(one for one in found if math.isfinite(one.value))


@pytest.mark.thorough
def test_a_planted_ship_is_found_again() -> None:
    problem = Problem(COASTER)
    planted = np.zeros(len(FACTORS))
    planted[problem.active] = 0.8 * np.random.default_rng(5).standard_normal(len(problem.active))
    stated = values_of(problem, planted, None)
    slow = Trial(kind="circle", speed_mps=3.0, angle_rad=math.radians(20.0))
    found = nominal(replace(COASTER, stated=stated), also=(slow,))
    by_key = {(one.trial, one.quantity): one for one in found.predicted}
    for one in stated:
        assert by_key[one.trial, one.quantity].value == pytest.approx(one.value, rel=1.5 * SCATTER[one.quantity])
    truth = Fleet(problem.ship, problem.parameters(planted)[None], fastest_mps=30.0).results(slow)
    unseen = [one for one in found.predicted if one.trial == slow]
    assert len(unseen) == 7
    for one in unseen:
        assert one.low <= truth[one.quantity][0] <= one.high
        assert one.value == pytest.approx(truth[one.quantity][0], rel=0.15)
    assert found.contradictions == ()


@pytest.mark.thorough
def test_planted_factors_lie_within_the_stated_covariance() -> None:
    """Of ships drawn from the prior, (estimate - truth)' C^-1 (estimate - truth) has the mean of chi square."""
    problem = Problem(COASTER)
    count, ships = len(problem.active), 5
    rng = np.random.default_rng(11)
    distances = []
    for _ in range(ships):
        planted = np.zeros(len(FACTORS))
        planted[problem.active] = 0.7 * rng.standard_normal(count)
        unknowns, covariance = fitted(problem, values_of(problem, planted, rng, (*SPEEDS, CIRCLE)))
        apart = unknowns - planted[problem.active]
        distances.append(apart @ np.linalg.solve(covariance, apart) / count)
    spread = 4 * math.sqrt(2 / count / ships)
    # directions that no value tells of keep the prior, from which these ships are drawn with seven tenths of its spread
    assert 0.49 - spread < np.mean(distances) < 1 + spread


@pytest.mark.thorough
def test_a_stated_circle_narrows_the_intervals() -> None:
    alone = nominal(COASTER, also=(CIRCLE, ZIGZAG)).predicted
    known = values_of(Problem(COASTER), np.zeros(len(FACTORS)), None)
    circle = tuple(one for one in known if one.trial == CIRCLE)
    after = nominal(replace(COASTER, stated=circle), also=(CIRCLE, ZIGZAG)).predicted

    def width(rows: tuple, trial: Trial, quantity: str) -> float:
        return next(math.log(one.high / one.low) for one in rows if (one.trial, one.quantity) == (trial, quantity))

    assert width(after, CIRCLE, "tactical_diameter_m") < 0.5 * width(alone, CIRCLE, "tactical_diameter_m")
    assert width(after, ZIGZAG, "overshoot_1_rad") < width(alone, ZIGZAG, "overshoot_1_rad")


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("nominal")
    assert main(["nominal", str(CARDS / "coaster-80m.toml"), "--out", str(folder), "--quiet"]) == 0
    return folder


@pytest.mark.thorough
def test_the_vessel_file_does_what_the_table_says(made: Path) -> None:
    vessel = load_vessel(made / "vessel.toml")
    rows = json.loads((made / "nominal.json").read_text())["trials"]
    speed = next(row["speed_mps"] for row in rows if row["trial"] == "zigzag")
    results = standard_results(vessel, speed_mps=speed, sides=("starboard",))
    by_key = {
        (row["trial"], round(row["speed_mps"], 6), round(row["angle_rad"], 3), row["quantity"]): row for row in rows
    }

    def told(kind: str, degrees: float, quantity: str) -> float:
        return by_key[kind, round(speed, 6), round(math.radians(degrees), 3), quantity]["value"]

    (circle,), (ten, twenty), (stop,) = results.circles, results.zigzags, results.stops
    assert circle.advance_m == pytest.approx(told("circle", 35, "advance_m"), rel=0.02)
    assert circle.tactical_diameter_m == pytest.approx(told("circle", 35, "tactical_diameter_m"), rel=0.02)
    assert ten.overshoots_rad == pytest.approx([told("zigzag", 10, f"overshoot_{n}_rad") for n in (1, 2)], rel=0.04)
    assert twenty.overshoots_rad[0] == pytest.approx(told("zigzag", 20, "overshoot_1_rad"), rel=0.03)
    assert stop.track_reach_m == pytest.approx(told("stop", 0, "reach_m"), rel=0.02)


def test_the_vessel_file_states_honest_scatter(made: Path) -> None:
    model = load_vessel(made / "vessel.toml").model
    assert (model.parameter_std > 0.02 * np.abs(model.parameters)).all()
    assert np.linalg.eigvalsh(model.parameter_correlation_matrix)[0] > 1e-6
    assert model.share_in_range() > 0.5
    names = list(model.names)
    sway, yaw = names.index("Y_urudder1"), names.index("N_urudder1")
    assert model.parameter_correlation_matrix[sway, yaw] < -0.7  # one rudder, behind midships


@pytest.mark.thorough
def test_ships_drawn_from_the_file_sail_as_the_table_says(made: Path) -> None:
    """The normal prior of a vessel file stands for the ships of the table, whose factors are drawn and simulated."""
    vessel = load_vessel(made / "vessel.toml")
    rows = json.loads((made / "nominal.json").read_text())["trials"]
    drawn = vessel.model.drawn_parameters(200, np.random.default_rng(3))
    fleet = Fleet(vessel, drawn, fastest_mps=30.0)
    circle = next(row for row in rows if row["trial"] == "circle")
    for row in (one for one in rows if (one["trial"], one["speed_mps"]) == ("circle", circle["speed_mps"])):
        trial = Trial(kind="circle", speed_mps=row["speed_mps"], angle_rad=row["angle_rad"])
        low, middle, high = np.quantile(fleet.results(trial)[row["quantity"]], [0.025, 0.5, 0.975])
        assert middle == pytest.approx(row["value"], rel=0.08)
        width = math.log(high / low) / math.log(row["high_95"] / row["low_95"])
        assert 0.6 < width < 1.5, row["quantity"]


def test_parameters_keep_the_signs_that_physics_gives(made: Path) -> None:
    model = load_vessel(made / "vessel.toml").model
    ranges = model.parameter_range
    assert {"X_abs_u_u", "N_ur", "X_n1", "X_n1_astern", "X_un1", "Y_urudder1", "Y_n1rudder1"} <= set(ranges)
    for name, value in zip(model.names, model.parameters, strict=True):
        low, high = ranges.get(name, (-math.inf, math.inf))
        assert low <= value <= high


@pytest.mark.thorough
@pytest.mark.parametrize("path", [*CARDS.glob("*.toml"), *SHIPS.glob("*.toml")], ids=lambda path: path.stem)
def test_ships_of_every_card_keep_to_their_own_ranges(path: Path) -> None:
    """The nominal ship is within the signs that her file states, and drawn ones not by rare luck."""
    problem = Problem(load_card(path))
    unknowns = np.zeros(len(FACTORS))
    ship = with_scatter(problem.ship, problem.slopes(unknowns), np.eye(len(problem.active)))
    for name, value in zip(ship.model.names, ship.model.parameters.tolist(), strict=True):
        low, high = ship.model.parameter_range.get(name, (-math.inf, math.inf))
        assert low <= value <= high, name
    assert ship.model.share_in_range() > 0.2


def test_values_that_contradict_are_named() -> None:
    known = values_of(Problem(COASTER), np.zeros(len(FACTORS)), None)
    wrong = tuple(
        replace(one, value=2.5 * one.value, source="circles[1].tactical_diameter_m")
        if (one.trial, one.quantity) == (CIRCLE, "tactical_diameter_m")
        else one
        for one in known
    )
    (said,) = nominal(replace(COASTER, stated=wrong)).contradictions
    assert said.startswith("circles[1].tactical_diameter_m is ")
    assert "left out" in said
    assert nominal(replace(COASTER, stated=known)).contradictions == ()


@pytest.mark.thorough
def test_particulars_that_no_ship_has_together_are_named() -> None:
    (screw,) = COASTER.thrusters
    weak = replace(COASTER, thrusters=(replace(screw, power_w=50e3),), top_speed_mps=10.0)
    assert any("kW" in said and "ship.top_speed_kn" in said for said in nominal(weak).contradictions)
    fast = Stated(
        trial=replace(CIRCLE, speed_mps=8.0), quantity="advance_m", value=330.0, source="circles[1].advance_m"
    )
    assert any(
        said.startswith("circles[1].speed_kn") for said in nominal(replace(COASTER, stated=(fast,))).contradictions
    )
    slow = replace(COASTER, thrusters=(replace(screw, max_rps=0.9),))
    assert any("pitch ratio of more than" in said for said in nominal(slow).contradictions)


@pytest.mark.thorough
def test_a_trial_without_end_is_shown_as_such(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A craft with a fin at the bow instead of the stern: heavy astern, she turns for ever in a zig-zag."""
    craft = '[ship]\nname = "s"\nlength_m = 12.0\nbeam_m = 3.5\ndraught_m = 1.6\nblock_coefficient = 0.6\n'
    craft += 'gravity_forward_m = -2.5\ntop_speed_kn = 9.0\n[[thrusters]]\nkind = "azimuth"\nforward_m = -3.0\n'
    card = tmp_path / "card.toml"
    card.write_text(craft)
    assert main(["nominal", str(card), "--out", str(tmp_path / "out")]) == 0
    assert "no end" in capsys.readouterr().out
    rows = json.loads((tmp_path / "out" / "nominal.json").read_text())["trials"]
    assert any(row["high_95"] is None for row in rows)
    assert load_vessel(tmp_path / "out" / "vessel.toml").name == "s"


SHIP = '[ship]\nname = "s"\nlength_m = 80.0\nbeam_m = 13.0\ndraught_m = 5.0\n'
SCREW = '[[thrusters]]\nkind = "propeller"\nforward_m = -38.0\n'
WRONG = {
    "no displacement": (SHIP + SCREW, "ship.displacement_t"),
    "two displacements": (SHIP + "displacement_t = 2000.0\nblock_coefficient = 0.7\n" + SCREW, "block_coefficient"),
    "too heavy": (SHIP + "displacement_t = 9000.0\n" + SCREW, "ship.displacement_t"),
    "unknown key": (SHIP + "block_coefficient = 0.7\nlenght_m = 3.0\n" + SCREW, "lenght_m"),
    "no thruster": (SHIP + "block_coefficient = 0.7\n", "thrusters"),
    "only tunnels": (SHIP + "block_coefficient = 0.7\n" + SCREW.replace("propeller", "tunnel"), "drives"),
    "out of the ship": (SHIP + "block_coefficient = 0.7\n" + SCREW.replace("-38", "-380"), "thrusters[1].forward_m"),
    "beside the ship": (
        SHIP + "block_coefficient = 0.7\n" + SCREW + "starboard_m = -20.0\n", "thrusters[1].starboard_m",
    ),
    "two hulls without their beam": (
        SHIP + "block_coefficient = 0.7\nhulls = 2\n" + SCREW, "ship.beam_over_all_m",
    ),
    "hulls wider than both": (
        SHIP + "block_coefficient = 0.7\nhulls = 2\nbeam_over_all_m = 20.0\n" + SCREW, "ship.beam_over_all_m",
    ),
    "rudder without area": (SHIP + "block_coefficient = 0.7\n" + SCREW + "[[rudders]]\nforward_m = -40.0\n", "area"),
    "circle without result": (
        SHIP + "block_coefficient = 0.7\n" + SCREW + "[[circles]]\nspeed_kn = 12.0\n", "circles[1]",
    ),
    "rpm without max": (
        SHIP + "block_coefficient = 0.7\n" + SCREW + "[[speeds]]\nrpm = 90.0\nspeed_kn = 9.0\n", "speeds[1].rpm",
    ),
    "drift without windage": (
        SHIP + "block_coefficient = 0.7\n" + SCREW + "[drift]\nwind_kn = 20.0\ndrift_kn = 1.0\n", "windage",
    ),
}  # fmt: skip


def test_a_catamaran_is_as_wide_as_both_hulls(tmp_path: Path) -> None:
    """Plans keep the vessel's beam off the shore, while the regressions are of one hull."""
    card = tmp_path / "card.toml"
    craft = SHIP.replace("80.0", "2.0").replace("13.0", "0.25").replace("5.0", "0.13")
    screws = "".join(SCREW.replace("-38.0", "-0.9") + f"starboard_m = {side}\n" for side in (-0.4, 0.4))
    card.write_text(craft + "hulls = 2\nbeam_over_all_m = 1.08\nblock_coefficient = 0.4\n" + screws)
    problem, out = Problem(load_card(card)), tmp_path / "vessel.toml"
    out.write_text(vessel_toml(problem.ship))
    assert problem.card.hull.beam_m == 0.25
    assert load_vessel(out).beam_m == 1.08


@pytest.mark.thorough
def test_what_a_helm_is_of_a_craft_without_one_is_said() -> None:
    """A circle's helm in the table is 35 degrees; her orders then differ by what the note says."""
    craft, coaster = (nominal(load_card(path)) for path in (SHIPS / "otter.toml", CARDS / "coaster-80m.toml"))
    orders = Helm(vessel=craft.vessel).inputs(0.2, math.radians(35.0))
    shares = [n / (limit.high if n > 0 else -limit.low) for n, limit in zip(orders, craft.vessel.limits, strict=True)]
    assert sorted(shares) == pytest.approx([0.2 - 0.57, 0.2 + 0.57], abs=0.005)
    assert BY_PROPELLERS in nominal_notes(craft)
    assert BY_PROPELLERS not in nominal_notes(coaster)


@pytest.mark.parametrize("name", WRONG)
def test_wrong_cards_are_refused_in_one_line(name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text, key = WRONG[name]
    card = tmp_path / "card.toml"
    card.write_text(text)
    assert main(["nominal", str(card), "--out", str(tmp_path / "out"), "--quiet"]) == 2
    said = capsys.readouterr().err.strip().splitlines()
    assert len(said) == 1
    assert key in said[0]
    assert not (tmp_path / "out").exists()


def test_units_of_a_card_are_a_mariners() -> None:
    card = load_card(CARDS / "offshore-45m.toml")
    assert card.top_speed_mps == pytest.approx(13 * 1852 / 3600)
    by_source = {one.source: one for one in card.stated}
    assert by_source["circles[1].time_90_s"].value == 28.0
    assert by_source["circles[1].advance_m"].trial.speed_mps == pytest.approx(10 * 1852 / 3600)
    assert by_source["speeds[1].speed_kn"].value == pytest.approx(6.8 * 1852 / 3600)
    assert by_source["speeds[1].speed_kn"].trial.order == 0.5
    assert card.drives[0].angle_rate_radps == pytest.approx(math.radians(12.0))


@pytest.mark.parametrize("kind", ["propeller", "azimuth", "podded"])
def test_drawn_ships_are_steered_to_the_side_of_the_nominal_one_and_sampled_some_times_a_length(kind: str) -> None:
    stern = replace(COASTER.thrusters[0], kind=kind, starboard_m=2.0)
    tunnel = Thruster(kind="tunnel", forward_m=30.0, power_w=2e5)
    rudders = COASTER.rudders if kind == "propeller" else ()
    ship = Problem(replace(COASTER, thrusters=(stern, tunnel), rudders=rudders)).ship
    model = ship.model
    steering = [name for name in model.names if STEERING.fullmatch(name)]
    assert steering
    wide = replace(model, parameter_std=0.5 * np.abs(model.parameters))
    drawn = wide.drawn_parameters(50, np.random.default_rng(0))
    for name in steering:
        index = model.names.index(name)
        assert (drawn[:, index] * model.parameters[index] >= 0.0).all()
    samples = ship.length_m / COASTER.top_speed_mps / ship.sample_time_s
    assert SAMPLES / 2 < samples < 2 * SAMPLES


GIVEN_OTHERWISE = {"starboard_m", "area_m2", "area_percent"}
"""Keys of rudders whose absence is no number: the centre line, and what another key gives."""
LEAST = SHIP + "block_coefficient = 0.7\ntop_speed_kn = 12.0\n" + "".join(
    SCREW.replace("propeller", kind) for kind in ("propeller", "azimuth", "podded", "tunnel")
) + "[[rudders]]\nforward_m = -39.0\narea_percent = 2.0\n"  # fmt: skip


def test_every_key_that_a_card_leaves_out_is_told_with_what_stands_for_it(tmp_path: Path) -> None:
    path = tmp_path / "card.toml"
    path.write_text(LEAST)
    card = load_card(path)
    told = {one.key: one.value for one in assumed(card, propellers(card))}
    turning = {"turn_max_deg", "turn_degps"}
    for number, thruster in enumerate(card.thrusters, start=1):
        keys = {key for key, field in ThrusterTable.model_fields.items() if not field.is_required()}
        keys -= {"starboard_m"} | (set() if thruster.kind in ("azimuth", "podded") else turning)
        keys -= {"power_kw"} if thruster.drives else {"astern_percent", "pitch_ratio"}
        assert {key for key in told if key.startswith(f"thrusters[{number}]")} == {
            f"thrusters[{number}].{key}" for key in keys
        }
    keys = {key for key, field in RudderTable.model_fields.items() if not field.is_required()} - GIVEN_OTHERWISE
    assert {key for key in told if key.startswith("rudders")} == {f"rudders[1].{key}" for key in keys}

    stated = "".join(f"{key.partition('.')[2]} = {value}\n" for key, value in told.items() if key.startswith("rudders"))
    path.write_text(LEAST + stated)
    again = load_card(path)
    assert again.rudders == card.rudders
    assert not [one for one in assumed(again, propellers(again)) if one.key.startswith("rudders")]


def test_the_vessel_file_and_the_page_say_what_is_assumed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "card.toml"
    path.write_text(LEAST)
    assert main(["nominal", str(path), "--out", str(tmp_path / "out")]) == 0
    shown = capsys.readouterr().out
    for text in (
        shown,
        (tmp_path / "out" / "vessel.toml").read_text(),
        (tmp_path / "out" / "nominal.html").read_text(),
    ):
        assert "rudders[1].rate_degps" in text
        assert "thrusters[2].turn_degps" in text
    assert json.loads((tmp_path / "out" / "nominal.json").read_text())["assumed"]["rudders[1].rate_degps"] == (
        pytest.approx(2.32)
    )
