"""Forces of actuators, the force a motion needs, and the commands that give a force."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from design_case import FREE, azimuth, force_actuator, structured, tunnel, vessel
from expdesign.errors import InputError, UnknownName
from expdesign.signals import Commands
from expdesign.vessel import (
    SCALAR,
    Actuator,
    Limit,
    Response,
    VesselModel,
    column_name,
    commands_for,
    force_matrix,
    generalised_force,
    required_push,
)

MODEL_SHIP = (
    azimuth(1, forward_m=-0.39, starboard_m=-0.07),
    azimuth(2, forward_m=-0.39, starboard_m=0.07),
    tunnel(3, forward_m=0.37),
)
"""Thrusters of the model ship of the thesis, chapter 9."""


def given_force(actuators: tuple[Actuator, ...], command: np.ndarray) -> np.ndarray:
    """(3,) generalised force of commands (m,)."""
    names = [name for actuator in actuators for name in actuator.signals]
    return np.array(generalised_force(actuators, dict(zip(names, command.tolist(), strict=True)), SCALAR))


def allocate(actuators: tuple[Actuator, ...], force: np.ndarray, **options: Any) -> np.ndarray:
    """Commands (..., k, m) for generalised forces (..., k, 3)."""
    model = VesselModel(
        terms=(), parameters=np.zeros(0), parameter_std=np.zeros(0), form="continuous", sample_time_s=1.0,
        actuators=actuators,
    )  # fmt: skip
    return commands_for(model, force, **options)


def test_azimuths_push_as_in_3_55():
    rng = np.random.default_rng(0)
    for _ in range(20):
        n, a, dx, dy = rng.standard_normal((4, 3))
        thrusters = tuple(azimuth(i + 1, forward_m=dx[i], starboard_m=dy[i]) for i in range(3))
        published = [
            sum(n * np.cos(a)),
            sum(n * np.sin(a)),
            sum(n * (dx * np.sin(a) - dy * np.cos(a))),
        ]
        command = np.stack([n, a], axis=1).ravel()
        np.testing.assert_allclose(given_force(thrusters, command), published, rtol=1e-12, atol=1e-13)


@pytest.mark.parametrize(
    ("actuator", "command", "force"),
    [
        (azimuth(forward_m=2.0, starboard_m=3.0), [5.0, 0.0], [5.0, 0.0, -15.0]),
        (azimuth(forward_m=2.0, starboard_m=3.0), [5.0, math.pi / 2], [0.0, 5.0, 10.0]),
        (azimuth(forward_m=2.0, starboard_m=3.0), [-5.0, math.pi], [5.0, 0.0, -15.0]),
        (tunnel(forward_m=4.0), [5.0], [0.0, 5.0, 20.0]),
        (
            Actuator(kind="propeller", number=1, forward_m=-4.0, starboard_m=2.0, limits=(FREE,)),
            [5.0],
            [5.0, 0.0, -10.0],
        ),
        (Actuator(kind="rudder", number=1, forward_m=-4.0, limits=(FREE,)), [0.3], [0.0, 0.0, 0.0]),
        (force_actuator(), [1.0, 2.0, 3.0], [1.0, 2.0, 3.0]),
    ],
)
def test_each_kind_pushes_along_its_axis_and_turns_by_its_lever(actuator: Actuator, command: list, force: list):
    np.testing.assert_allclose(given_force((actuator,), np.array(command)), force, atol=1e-14)


def test_columns_have_the_units_of_their_signals():
    assert [column_name(s) for s in ("n1", "a12", "rudder1", "tau_x", "tau_psi")] == [
        "n1_rps", "a12_rad", "rudder1_rad", "tau_x", "tau_psi"
    ]  # fmt: skip


def test_the_force_matrix_is_the_force_of_unit_thrusts():
    matrix = force_matrix(MODEL_SHIP)
    units = [
        (1, 0.0, 0, 0, 0),
        (1, math.pi / 2, 0, 0, 0),
        (0, 0, 1, 0.0, 0),
        (0, 0, 1, math.pi / 2, 0),
        (0, 0, 0, 0, 1),
    ]
    forces = np.stack([given_force(MODEL_SHIP, np.array(unit, dtype=float)) for unit in units], axis=1)
    np.testing.assert_allclose(matrix, forces, atol=1e-15)


@pytest.mark.parametrize("structure", ["manoeuvring-10", "manoeuvring-18"])
def test_the_required_force_gives_the_desired_acceleration(structure: str):
    rng = np.random.default_rng(1)
    size = {"manoeuvring-10": 10, "manoeuvring-18": 18}[structure]
    for _ in range(20):
        model = structured(structure, rng.uniform(0.2, 1.0, size), (force_actuator(),), sample_time_s=0.5)
        velocity, acceleration = rng.uniform(0.0, 1.0, 3), rng.standard_normal(3)
        force = required_push(model, velocity, acceleration)
        np.testing.assert_allclose(
            model.accelerations(velocity, velocity[:2], force), acceleration, rtol=1e-9, atol=1e-11
        )


def test_a_direction_that_cannot_be_pushed_does_not_spoil_the_others():
    model = structured("surge", np.array([-0.2, -0.1, 0.0, 0.01]), (force_actuator(),))
    force = required_push(model, np.array([2.0, 0.0, 0.0]), np.array([0.5, 0.3, 0.1]))
    assert model.accelerations((2.0, 0.0, 0.0), (2.0, 0.0), force)[0] == pytest.approx(0.5, rel=1e-12)
    assert abs(force[1:]).max() < 1e-12 * abs(force[0])


@pytest.mark.parametrize(
    "actuators", [MODEL_SHIP, vessel("azimuth-30m").actuators, (force_actuator(),), MODEL_SHIP[1:]], ids=range(4)
)
def test_allocated_commands_give_every_reachable_force(actuators: tuple[Actuator, ...]):
    for wish in np.random.default_rng(2).standard_normal((50, 3)):  # one by one, as rates hold between rows
        command = allocate(actuators, wish[None], sample_time_s=1.0)[0]
        np.testing.assert_allclose(given_force(actuators, command), wish, rtol=1e-11, atol=1e-12)


def test_fewer_thrusters_come_as_close_as_they_can():
    wish = np.array([3.0, 1.0, 5.0])
    ahead, side = given_force((azimuth(),), allocate((azimuth(),), wish[None], sample_time_s=1.0)[0])[:2]
    assert (ahead, side) == pytest.approx((3.0, 1.0))


def slewing(actuator: Actuator, *rates: float) -> Actuator:
    return replace(actuator, responses=tuple(Response(rate=rate) for rate in rates))


@pytest.mark.parametrize("draw", range(5))
def test_limits_and_rates_hold_whatever_is_desired(draw: int):
    rng = np.random.default_rng(draw)
    actuators = (
        slewing(azimuth(1, speed=Limit(low=-3, high=15), forward_m=9.0), 1.5, 0.25),
        slewing(
            azimuth(2, speed=Limit(low=0, high=15), angle=Limit(low=-2.0, high=2.0), forward_m=-9.0), math.inf, 0.5
        ),
        slewing(tunnel(3, speed=Limit(low=-4, high=4), forward_m=3.0), 0.3),
        Actuator(kind="rudder", number=1, limits=(Limit(low=-0.6, high=0.6),)),
    )
    limits = [limit for actuator in actuators for limit in actuator.limits]
    low, high = (np.array([getattr(limit, name) for limit in limits]) for name in ("low", "high"))
    rate = np.array([response.rate for actuator in actuators for response in actuator.responses])
    before = np.zeros(len(limits))
    commands = allocate(actuators, 100 * rng.standard_normal((200, 3)), sample_time_s=0.5, before=before)
    steps = np.abs(np.diff(np.vstack([before, commands]), axis=0))
    assert (commands >= low).all()
    assert (commands <= high).all()
    assert (steps <= 0.5 * rate + 1e-12).all()


def test_a_thrust_that_reverses_keeps_the_angle():
    ahead = np.concatenate([np.linspace(10, -10, 41), np.linspace(-10, 10, 41)])
    force = np.stack([ahead, 0 * ahead, 0 * ahead], axis=1)
    commands = allocate((azimuth(speed=Limit(low=-8, high=8)),), force, sample_time_s=1.0, before=np.zeros(2))
    np.testing.assert_allclose(commands[:, 0], np.clip(ahead, -8, 8), atol=1e-12)
    np.testing.assert_allclose(commands[:, 1], 0.0, atol=1e-12)


@pytest.mark.parametrize("draw", range(5))
def test_a_propeller_that_reverses_alike_never_turns_more_than_a_quarter(draw: int):
    rng = np.random.default_rng(draw)
    force = rng.standard_normal((300, 3)) * rng.choice([0.0, 1e-12, 1.0, 100.0], (300, 1))
    actuators = (azimuth(speed=Limit(low=-15, high=15)),)
    angles = allocate(actuators, force, sample_time_s=1.0, before=np.array([0.0, 40.0]))[:, 1]
    assert np.abs(np.diff(angles, prepend=40.0)).max() <= math.pi / 2 + 1e-9


def test_an_azimuth_without_thrust_stays_where_it_is():
    commands = allocate((azimuth(),), np.zeros((3, 3)), sample_time_s=1.0, before=np.array([4.0, 2.5]))
    np.testing.assert_array_equal(commands, np.tile([0.0, 2.5], (3, 1)))


@pytest.mark.parametrize(
    ("speed", "angle", "before", "wish", "command"),
    [
        (Limit(low=-2, high=10), FREE, 0.0, (-5.0, 0.0), (5.0, -math.pi)),  # astern is too weak: turn round
        (Limit(low=-10, high=10), FREE, 0.0, (-20.0, 0.0), (-10.0, 0.0)),  # neither suffices: stay
        (Limit(low=-10, high=10), Limit(low=-0.1, high=0.1), 0.0, (-5.0, 0.0), (-5.0, 0.0)),
        (Limit(low=0, high=10), Limit(low=-1.0, high=1.0), 0.0, (-5.0, 0.0), (0.0, None)),  # the wrong way is no help
        (Limit(low=0, high=10), Limit(low=-1.0, high=1.0), 0.0, (0.0, 5.0), (5.0 * math.sin(1.0), 1.0)),
        (FREE, Limit(low=-3.2, high=3.2), 3.0, (-5.0, -0.5), (-math.hypot(5.0, 0.5), math.atan2(0.5, 5.0))),  # the stop
    ],
)
def test_azimuths_come_as_close_to_the_thrust_as_limits_let_them(
    speed: Limit, angle: Limit, before: float, wish: tuple[float, float], command: tuple[float, float | None]
):
    (got,) = allocate(
        (azimuth(speed=speed, angle=angle),),
        np.array([[*wish, 0.0]]),
        sample_time_s=1.0,
        before=np.array([0.0, before]),
    )
    assert got[0] == pytest.approx(command[0], abs=1e-12)
    if command[1] is not None:
        assert math.cos(got[1] - command[1]) == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("low", [-10.0, -4.0, 0.0])
def test_an_azimuth_without_stops_finds_what_trying_all_half_turns_finds(low: float):
    rng, halves = np.random.default_rng(6), np.arange(-9, 10)
    for wish, near in zip(rng.normal(0.0, 8.0, (200, 2)), rng.uniform(-9.0, 9.0, 200), strict=True):
        (got,) = allocate(
            (azimuth(speed=Limit(low=low, high=10.0)),),
            np.array([[*wish, 0.0]]),
            sample_time_s=1.0,
            near=np.array([0.0, near]),
        )
        desired = np.hypot(*wish)
        speeds = np.clip(np.where(halves % 2 == 0, desired, -desired), low, 10.0)
        angles = np.arctan2(wish[1], wish[0]) + np.pi * halves
        given = speeds[:, None] * np.stack([np.cos(angles), np.sin(angles)], axis=1)
        missed = np.round(np.hypot(*(given - wish).T), 6)
        turns = np.where(missed <= missed.min(), np.abs(angles - near), np.inf)
        np.testing.assert_allclose(got, [speeds[turns.argmin()], angles[turns.argmin()]], atol=1e-9)


def test_limits_that_hold_nothing_are_refused():
    for wrong in ({"low": 1.0, "high": 1.0}, {"low": 2.0, "high": 1.0}, {"low": math.nan}):
        with pytest.raises(InputError):
            Limit(**wrong)


def test_unknown_signals_of_commands_are_named():
    commands = Commands(sample_time_s=1.0, names=("n1", "a1"), values=np.zeros((2, 2)))
    with pytest.raises(UnknownName, match="'n2', did you mean 'n1'"):
        commands.column("n2")


@pytest.mark.parametrize("turns", [0.5, 1.0, 2.0])
def test_a_thrust_that_goes_round_winds_an_azimuth_no_farther_than_its_turns(turns: float):
    """Without stops it follows three times round; with them it unwinds, and pushes as asked where its slew allows."""
    bearing = np.linspace(0.0, 6.0 * np.pi, 400)
    wish = np.stack([5.0 * np.cos(bearing), 5.0 * np.sin(bearing), np.zeros(400)], axis=1)
    most = 2.0 * np.pi * turns
    speed, angle = Limit(low=0.0, high=10.0), Limit(low=-most, high=most)
    free, stopped = (
        allocate((azimuth(speed=speed, angle=one),), wish, sample_time_s=1.0, before=np.zeros(2))
        for one in (FREE, angle)
    )
    assert free[:, 1].max() == pytest.approx(6.0 * np.pi)
    assert np.abs(stopped[:, 1]).max() <= most
    given = stopped[:, :1] * np.stack([np.cos(stopped[:, 1]), np.sin(stopped[:, 1])], axis=1)
    np.testing.assert_allclose(given, wish[:, :2], atol=1e-9)
