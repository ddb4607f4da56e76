"""Linear truths of roll, simulated exactly between samples: a pendulum on a cart, and a ship in sway, roll and yaw."""

from dataclasses import dataclass, replace

import numpy as np
import scipy

from expdesign.roll import (
    NOMINAL,
    Body,
    Case,
    Load,
    RollProblem,
    Run,
    axis_inertia,
    build_problem,
    first_moment,
    froude_scaled,
    named,
    parameters,
    stiffness,
)
from expdesign.values import Array

PENDULUM = Body(mass_kg=22.04, z_g=-0.018, z_s=-0.218)
PENDULUM_TRUTH = parameters(k=10.39, A_x=0.1385, d=0.1067, m=0.2, z_m=-0.274)
"""Of the simulated pendulum in the thesis (table 4.3)."""
MODEL_SHIP = Body(mass_kg=22.04, z_g=0.0073, z_s=-0.23)
MODEL_SHIP_TRUTH = parameters(
    k=9.0, A_x=0.157, d=0.267, K_r=-2.0, K_vd=0.95, K_delta=-0.45, z_f=-0.0294, m=0.4, z_m=-0.268
)
"""Near the estimates of the thesis's model ship (its tables of chapter 6)."""
System = tuple[Array, Array, Array, Array]
Helm = tuple[float, float, float]
SERVO_S = 0.1  # lag of the rudder behind its orders


@dataclass(frozen=True, kw_only=True)
class Sea:
    """Noise: white on each sensor, and a narrow-band roll moment.

    Attributes:
        roll_rate, sensed, yaw_rate: standard deviations of the sensors [rad/s, m/s2, rad/s].
        moment: of the roll moment [N m].
        frequency_hz, damping: of the filter that shapes the moment.
    """

    roll_rate: float = 0.0
    sensed: float = 0.0
    yaw_rate: float = 0.0
    moment: float = 0.0
    frequency_hz: float = 1.0
    damping: float = 0.1


LITTLE = Sea(roll_rate=0.002, sensed=0.005, yaw_rate=0.002, moment=0.01, frequency_hz=0.8, damping=0.3)
ROUGH = parameters(k=9, A_x=0.5, d=0.1, K_r=-0.4, K_vd=1, K_delta=-0.4, z_f=-0.018, m=0.1, z_m=-0.2)
"""Where searches begin, and typical sizes of the parameters."""
SIZES = np.array([10, 0.2, 0.3, 2, 1, 0.5, 0.03, 0.3, 0.3])


def switching(count: int, hold: int, rng: np.random.Generator, *, levels: tuple[float, ...] = (-1.0, 1.0)) -> Array:
    """A rudder (k,) that takes one of the levels at random for so many samples each."""
    return np.repeat(rng.choice(levels, size=count // hold + 1), hold)[:count]


def shaped(count: int, sea: Sea, step_s: float, rng: np.random.Generator) -> Array:
    """The roll moment (k,)."""
    if not sea.moment:
        return np.zeros(count)
    w = 2.0 * np.pi * sea.frequency_hz
    above, below = scipy.signal.bilinear([1.0, 0.0], [1.0, 2.0 * sea.damping * w, w * w], fs=1.0 / step_s)
    drawn = scipy.signal.lfilter(above, below, rng.standard_normal(count + 4000))[4000:]
    return np.asarray(sea.moment * drawn / drawn.std())


def pendulum_run(
    load: Load, rudder: Array, sea: Sea, rng: np.random.Generator, *, step_s: float = 0.01, lag_s: float = 0.2
) -> Run:
    """The pendulum under a_y = rudder / (lag p + 1)."""
    values, body = named(PENDULUM_TRUTH), PENDULUM
    inertia, moment = axis_inertia(values["A_x"], body, load), first_moment(body, load)
    right = stiffness(PENDULUM_TRUTH, body, load)
    A = np.array([[0.0, 1.0, 0.0], [-right / inertia, -values["d"] / inertia, moment / inertia], [0, 0, -1.0 / lag_s]])
    B = np.array([[0.0, 0.0], [0.0, 1.0 / inertia], [1.0 / lag_s, 0.0]])
    sensed = body.z_s * A[1] + [9.81, 0.0, -1.0], body.z_s * B[1]
    C, D = np.array([[0, 1.0, 0], sensed[0], [0, 0, 0]]), np.array([[0, 0], sensed[1], [0, 0]])
    return _measured(_steered((A, B, C, D)), rudder, sea, step_s, rng)


@dataclass(frozen=True, kw_only=True)
class Hull:
    """Sway and yaw of the ship, per unit of v [m/s], r [rad/s], roll [rad] and rudder [rad]."""

    speed: float = 0.8
    sway_mass: float = 39.0
    sway: tuple[float, float, float, float] = (-25.0, -14.0, 0.0, 5.0)
    yaw_inertia: float = 1.5
    yaw: tuple[float, float, float, float] = (-2.0, -2.0, 0.3, -2.0)
    sway_by_roll_acceleration: float = 0.3


def ship_system(theta: Array, body: Body, load: Load, hull: Hull = Hull()) -> System:
    """Matrices of the ship with states (roll, v, roll rate, r), inputs (rudder, roll moment), outputs as in `Run`."""
    values = named(theta)
    z_f, U = values["z_f"], hull.speed
    moment = first_moment(body, load, z_f)
    K_ur = values["K_vd"] + values["K_r"] / U
    mass = np.diag([1.0, hull.sway_mass + load.mass_kg, axis_inertia(values["A_x"], body, load, z_f), hull.yaw_inertia])
    mass[1, 2], mass[2, 1] = -moment - hull.sway_by_roll_acceleration, -moment - values["K_vd"]
    (sv, sr, sphi, sd), (nv, nr, nphi, nd) = hull.sway, hull.yaw
    F = np.array(
        [[0, 0, 1.0, 0], [sphi, sv, 0, sr], [-stiffness(theta, body, load), 0, -values["d"], (K_ur + moment) * U],
         [nphi, nv, 0, nr]]
    )  # fmt: skip
    A, B = (
        np.linalg.solve(mass, F),
        np.linalg.solve(mass, np.array([[0, 0], [sd, 0], [values["K_delta"], 1.0], [nd, 0]])),
    )
    z_s = body.sensor(z_f)
    C = np.array([[0, 0, 1.0, 0], z_s * A[2] + [9.81, 0, 0, 0] - A[1] - [0, 0, 0, U], [0, 0, 0, 1.0]])
    return A, B, C, np.array([[0, 0], z_s * B[2] - B[1], [0, 0]])


def ship_run(
    load: Load, rudder: Array, sea: Sea, rng: np.random.Generator, *, step_s: float = 0.02,
    theta: Array = MODEL_SHIP_TRUTH, body: Body = MODEL_SHIP, hull: Hull = Hull(),
    helm: Helm = (0.0, 0.0, 0.0),
) -> Run:  # fmt: skip
    """A run of the ship; helm is the rudder that an autopilot adds per heading, yaw and roll rate."""
    system = _on_course(_steered(ship_system(theta, body, load, hull)), helm)
    return _measured(system, rudder, sea, step_s, rng)


def _on_course(system: System, helm: Helm, lag_s: float = SERVO_S) -> System:
    """With the heading as last state, which an autopilot holds; yaw rate and rudder are states 3 and 4."""
    A, B, C, D = system
    A = np.block([[A, np.zeros((5, 1))], [np.eye(5)[3], np.zeros(1)]])
    A[4, [5, 3, 2]] += np.array(helm) / lag_s
    return A, np.vstack([B, np.zeros((1, 2))]), np.column_stack([C, np.zeros(4)]), D


def nonlinear_run(
    load: Load, orders: Array, sea: Sea, rng: np.random.Generator, *, damping: float, cross_flow: float, stall: float,
    step_s: float = 0.01,
) -> Run:  # fmt: skip
    """A run of the ship with a moment -damping p|p| - cross_flow v|v| + stall delta^3 on top, held over samples."""
    system = _steered(ship_system(MODEL_SHIP_TRUTH, MODEL_SHIP, load))
    A, B, C, D, _ = scipy.signal.cont2discrete(system, step_s)
    waves, state = shaped(len(orders), sea, step_s, rng), np.zeros(5)
    outputs = np.empty((len(orders), 4))
    for k, order in enumerate(orders):
        _, v, p, _, rudder = state
        moment = waves[k] - damping * p * abs(p) - cross_flow * v * abs(v) + stall * rudder**3
        outputs[k] = C @ state + D @ [order, moment]
        state = A @ state + B @ [order, moment]
    noise = np.array([sea.roll_rate, sea.sensed, sea.yaw_rate, 0.0]) * rng.standard_normal(outputs.shape)
    return Run(step_s=step_s, signals=outputs + noise)


def halves(run: Run) -> tuple[Run, Run]:
    """Of a run."""
    middle = len(run.signals) // 2
    return Run(step_s=run.step_s, signals=run.signals[:middle]), Run(step_s=run.step_s, signals=run.signals[middle:])


def full_scale(scale: float, hull: Hull = Hull()) -> tuple[Array, Body, Hull]:
    """The model ship by Froude's law: parameters, masses and places, sway and yaw, in kg^a m^b s^c by a + b + c / 2."""
    theta = froude_scaled(MODEL_SHIP_TRUTH, scale)
    body = Body(mass_kg=MODEL_SHIP.mass_kg * scale**3, z_g=MODEL_SHIP.z_g * scale, z_s=MODEL_SHIP.z_s * scale)
    sway, yaw = (
        np.array(hull.sway) * scale ** np.array([2.5, 3.5, 3, 3]),
        np.array(hull.yaw) * scale ** np.array([3.5, 4.5, 4, 4]),
    )
    ship = Hull(
        speed=hull.speed * scale**0.5, sway_mass=hull.sway_mass * scale**3, sway=tuple(sway.tolist()),
        yaw_inertia=hull.yaw_inertia * scale**5, yaw=tuple(yaw.tolist()),
        sway_by_roll_acceleration=hull.sway_by_roll_acceleration * scale**4,
    )  # fmt: skip
    return theta, body, ship


def limited(orders: Array, rate: float, step_s: float) -> Array:
    """Orders (k,) as a rudder of so many radians in a second follows them."""
    result = np.array(orders, dtype=float)
    for k in range(1, len(result)):
        result[k] = result[k - 1] + np.clip(result[k] - result[k - 1], -rate * step_s, rate * step_s)
    return result


def full_scale_problem(
    rate_degps: float, moment: float, rng: np.random.Generator, *, hold_s: float = 8.0, minutes: float = 10.0
) -> tuple[Array, RollProblem]:
    """The truth, and three load cases of the ship 24 times the model, k known, the rudder at 20 degrees or none."""
    scale, step_s = 24.0, 0.05
    theta, body, hull = full_scale(scale)
    sea = Sea(roll_rate=0.001, sensed=0.02, yaw_rate=0.001, moment=moment, frequency_hz=0.16, damping=0.3)
    cases = []
    for load in (NOMINAL, Load(mass_kg=CALIBRATION.mass_kg * scale**3, z_m=CALIBRATION.z_m * scale), None):
        wished = switching(round(60 * minutes / step_s), round(hold_s / step_s), rng, levels=(-0.35, 0.0, 0.35))
        orders = limited(wished, np.deg2rad(rate_degps), step_s)
        there = load or unknown_load(theta)
        run = ship_run(there, orders, sea, rng, step_s=step_s, theta=theta, body=body, hull=hull)
        cases.append(Case(name="ship", load=load, runs=(run,)))
    known = {"k": float(theta[0])}
    return theta, build_problem(body, tuple(cases), beam_m=7.2, roll_hz=0.16, known=known, start={})


def unknown_load(theta: Array = MODEL_SHIP_TRUTH) -> Load:
    """What the estimate is to find."""
    values = named(theta)
    return Load(mass_kg=values["m"], z_m=values["z_m"])


def quiet(sea: Sea) -> Sea:
    """The same without sensor noise."""
    return replace(sea, roll_rate=0.0, sensed=0.0, yaw_rate=0.0)


def _measured(system: System, orders: Array, sea: Sea, step_s: float, rng: np.random.Generator) -> Run:
    moment = shaped(len(orders), sea, step_s, rng)
    outputs = held_response(system, np.column_stack([orders, moment]), step_s)
    noise = np.array([sea.roll_rate, sea.sensed, sea.yaw_rate, 0.0]) * rng.standard_normal((len(orders), 4))
    return Run(step_s=step_s, signals=outputs + noise)


def _steered(system: System, lag_s: float = SERVO_S) -> System:
    """With a rudder that follows its orders with a lag; its angle is the last output."""
    A, B, C, D = system
    n, turn, steady = len(A), 1.0 / lag_s, np.zeros((1, 2))
    A = np.block([[A, B[:, :1]], [np.zeros((1, n)), -turn]])
    C = np.block([[C, D[:, :1]], [np.zeros((1, n)), 1.0]])
    B, D = (np.vstack([np.column_stack([0.0 * x[:, 0], x[:, 1]]), steady]) for x in (B, D))
    B[-1, 0] = turn
    return A, B, C, D


def held_response(system: System, inputs: Array, step_s: float) -> Array:
    """Outputs (k, n) at the samples, inputs (k, m) held between them."""
    A, B, C, D, _ = scipy.signal.cont2discrete(system, step_s)
    poles, modes = np.linalg.eig(A)
    driven = np.linalg.solve(modes, B.astype(complex)) @ inputs.T
    states = np.zeros_like(driven)
    for place, pole in enumerate(poles):
        states[place, 1:] = scipy.signal.lfilter([1.0], [1.0, -pole], driven[place])[:-1]
    return np.asarray((C @ (modes @ states)).real.T + inputs @ D.T)


CALIBRATION = Load(mass_kg=0.2, z_m=-0.256)
CASES = (NOMINAL, CALIBRATION, None)
