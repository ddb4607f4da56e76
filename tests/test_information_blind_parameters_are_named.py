"""Exactly the parameters that are not identifiable from a dictionary are named, in any units."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from design_case import WIND, example_dictionary, one_line, scored_example, spec, vessel
from expdesign.dictionary import Primitive, build_primitive
from expdesign.durations import build_durations
from expdesign.errors import NotInformative
from expdesign.information import (
    MEAN_SUBTRACTIONS,
    PrimitiveInformation,
    check_informative,
    estimated_parameters,
    score_primitives,
)
from expdesign.simulation import CALM, Environment
from expdesign.vessel import Vessel

SURGE = {"X_u", "X_vr", "X_abs_u_u", "W_abs_u_u", "X_mu", "X_kappa"}
COLLINEAR_IN_CALM = {"X_abs_u_u", "W_abs_u_u", "Y_abs_v_v", "W_abs_v_v", "N_uv", "W_uv"}
subtractions = pytest.mark.parametrize("subtraction", MEAN_SUBTRACTIONS)


def straight_line(ship: Vessel) -> list[Primitive]:
    """A dictionary without any turn or sideways motion."""
    return [build_primitive(ship, spec(name, duration_s=60, speed_mps=1)) for name in ("acceleration", "deceleration")]


def blind(ship: Vessel, primitives: Sequence[Primitive], sea: Environment, subtraction: str, **options: object) -> set:
    """Names in the refusal, empty when there is none."""
    names = estimated_parameters(ship.model, options.get("fixed_parameters", ()))
    items = score_primitives(ship, primitives, environment=sea, mean_subtraction=subtraction, **options)
    return refused(items, names, subtraction)


def refused(items: Sequence[PrimitiveInformation], names: Sequence[str], subtraction: str) -> set:
    """Names in the refusal, empty when there is none."""
    try:
        check_informative(items, names, subtraction)
    except NotInformative as error:
        return set(error.parameters)
    return set()


@subtractions
def test_without_wind_water_and_air_drag_cannot_be_separated(subtraction: str):
    names = vessel("azimuth-30m").model.names
    assert refused(scored_example("standard", CALM), names, subtraction) == COLLINEAR_IN_CALM
    assert refused(scored_example("standard", WIND), names, subtraction) == set()
    fixed = ("W_abs_u_u", "W_abs_v_v", "W_uv")
    few = example_dictionary("standard")[::3]
    assert blind(vessel("azimuth-30m"), few, CALM, subtraction, fixed_parameters=fixed) == set()


@subtractions
@pytest.mark.parametrize("name", ["model-ship", "azimuth-30m"])
def test_straight_lines_do_not_inform_about_sway_and_yaw(name: str, subtraction: str):
    ship = vessel(name)
    unseen = {"X_vr"} | (set(ship.model.names) - SURGE)
    pair = {"X_abs_u_u", "W_abs_u_u"} & set(ship.model.names) if name == "azimuth-30m" else set()
    assert blind(ship, straight_line(ship), CALM, subtraction) == unseen | pair


def test_with_wind_straight_lines_show_side_wind_unless_each_runs_mean_is_taken_off():
    ship = vessel("azimuth-30m")
    unseen = {"X_vr"} | (set(ship.model.names) - SURGE - {"W_uv"})
    for subtraction in ("none", "complete"):
        assert blind(ship, straight_line(ship), WIND, subtraction) == unseen - {"W_abs_v_v"}
    # On one heading the side wind is constant; only its change between headings would show.
    assert blind(ship, straight_line(ship), WIND, "batch") == unseen


def test_rounding_of_a_thruster_turned_round_is_no_excitation():
    ship = vessel("azimuth-30m")
    half_turn = np.array([0, np.pi, 0, np.pi])
    turned = [  # astern by turning both thrusters half a turn: sin(pi) is not quite zero, and sways the ship a little
        replace(
            primitive,
            commands=replace(primitive.commands, values=primitive.commands.values * (-1, 1, -1, 1) + half_turn),
            entry_inputs=primitive.entry_inputs * (-1, 1, -1, 1) + half_turn,
        )
        for primitive in straight_line(ship)
    ]  # fmt: skip
    assert {"Y_v", "Y_mu", "N_r", "N_mu", "Y_abs_v_v"} <= blind(ship, turned, CALM, "none")


@subtractions
@pytest.mark.parametrize("seed", range(3))
def test_units_of_the_parameters_do_not_change_what_is_blind(subtraction: str, seed: int):
    ship = vessel("azimuth-30m")
    names = estimated_parameters(ship.model, ())
    units = 10.0 ** np.random.default_rng(seed).uniform(-6, 6, len(names))
    for sea, expected in ((CALM, COLLINEAR_IN_CALM), (WIND, set())):
        scaled = [
            replace(
                item,
                X=item.X * np.outer(units, units),
                YZ=item.YZ * np.outer(units, units),
                Y=item.Y * units[:, None],
                Z=item.Z * units[:, None],
            )
            for item in scored_example("standard", sea)
        ]
        assert refused(scaled, names, subtraction) == expected


def test_what_never_changes_is_blind_once_means_are_taken_off():
    (item,) = score_primitives(vessel("model-ship"), example_dictionary("model-ship")[9:10])
    names = estimated_parameters(vessel("model-ship").model, ())
    rng = np.random.default_rng(0)
    rows = rng.standard_normal((50, len(names)))
    rows[:, 0] = 1e3 / 3  # the surge speed, say, always the same
    same = np.equal.outer([t.equation for t in vessel("model-ship").model.terms], [t.equation for t in
                          vessel("model-ship").model.terms])  # fmt: skip
    member = np.equal.outer([t.equation for t in vessel("model-ship").model.terms], ["u", "v", "r"])
    Y = member * rows.mean(axis=0)[:, None]
    steady = replace(item, X=same * (rows.T @ rows) / 50, Y=Y, Z=Y, YZ=Y @ Y.T)
    assert refused([steady], names, "none") == set()
    assert refused([steady], names, "complete") == {"X_u"}
    assert refused([steady], names, "batch") == {"X_u"}


def test_what_changes_only_between_runs_is_blind_to_batches_alone():
    ship = vessel("model-ship")
    names = estimated_parameters(ship.model, ())
    (item,) = score_primitives(ship, example_dictionary("model-ship")[9:10])
    p = len(names)

    def steady(values: np.ndarray) -> PrimitiveInformation:
        member = np.equal.outer([t.equation for t in ship.model.terms], ["u", "v", "r"])
        Y = member * values[:, None]
        return replace(item, X=Y @ Y.T, Y=Y, Z=Y, YZ=Y @ Y.T)

    items = [steady(values) for values in np.random.default_rng(1).standard_normal((2 * p, p))]
    assert refused(items, names, "none") == set()
    assert refused(items, names, "complete") == set()
    assert refused(items, names, "batch") == set(names)


@subtractions
def test_no_durations_are_made_for_a_dictionary_that_leaves_parameters_blind(subtraction: str):
    ship = vessel("azimuth-30m")
    items = score_primitives(ship, straight_line(ship), mean_subtraction=subtraction)
    with pytest.raises(NotInformative, match=r"cannot separate these parameters: X_vr, .*N_mu") as caught:
        build_durations(items, estimated_parameters(ship.model, ()), total_s=600.0, mean_subtraction=subtraction)
    assert one_line(caught.value)
