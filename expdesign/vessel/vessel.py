"""The vessel: particulars, hull outline, model, sensors and the weather it was found in."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import shapely

from expdesign.errors import InputError, UnknownName
from expdesign.values import Array, seal
from expdesign.vessel.actuators import Actuator, Limit
from expdesign.vessel.model import VesselModel
from expdesign.vessel.quantities import EXACT, Response, Sensors, rows_of
from expdesign.vessel.roll import RollPendulum


@dataclass(frozen=True, kw_only=True)
class Variation:
    """A stationary first-order Gauss-Markov process, one for each n-frame component, around the trial's mean.

    Its autocorrelation is std_mps**2 exp(-|lag| / correlation_s); a correlation time of zero is white noise from sample
    to sample.


    Source: A. Gelb (ed.), Applied Optimal Estimation (1974), section 3.8 (exponentially correlated processes).
    """

    std_mps: float = 0.0  # standard deviation of each component [m/s]
    correlation_s: float = 0.0  # correlation time [s]

    def __post_init__(self) -> None:
        for name, value in vars(self).items():
            if not 0 <= value < math.inf:
                raise InputError(f"variation.{name} is {value:g}, expected 0 or more")

    def memory(self, time_s: float) -> float:
        """Correlation of values that lie a time apart."""
        return math.exp(-time_s / self.correlation_s) if self.correlation_s > 0 else 0.0


STEADY = Variation()  # no variation
SEA_STATES = range(10)  # codes of the World Meteorological Organization, table 3700


@dataclass(frozen=True, kw_only=True, eq=False)
class Environment:
    """Forecast for a trial: its mean current and wind, and how they vary while it lasts."""

    current_to: Array = field(default_factory=lambda: np.zeros(2))  # (2,) mean current, velocity to north/east [m/s]
    wind_to: Array = field(default_factory=lambda: np.zeros(2))  # (2,) mean wind, velocity to north/east [m/s]
    current_std_mps: float = 0.0  # standard deviation with which the trial's mean of each component is known [m/s]
    wind_std_mps: float = 0.0  # standard deviation with which the trial's mean of each component is known [m/s]
    # current_variation, wind_variation: what happens around the trial's mean from sample to sample
    current_variation: Variation = STEADY
    wind_variation: Variation = STEADY
    # WMO code 0 (calm) to 9 (phenomenal) of table 3700, or None when not given; it is stated beside the limits on
    # trials and moves no ship here
    sea_state: int | None = None

    def __post_init__(self) -> None:
        seal(self, current_to="2", wind_to="2")
        if self.sea_state is not None and self.sea_state not in SEA_STATES:
            raise InputError(f"sea_state is {self.sea_state}, expected a whole number from 0 to 9")

    @property
    def isotropic(self) -> bool:
        """True when no mean current or wind singles out a heading."""
        return not (self.current_to.any() or self.wind_to.any())

    @property
    def steady(self) -> bool:
        """True when current and wind keep their means through the trial."""
        return not (self.current_variation.std_mps or self.wind_variation.std_mps)


CALM = Environment()


def hull_outlines(pose: Array, hull_b: Array) -> Array:
    """(k, c, 2) hull corners in the n-frame, as (east, north) for shapely.

    Args:
        pose: (k, 3) n-frame.
        hull_b: (c, 2) corners forward/starboard [m].
    """
    c, s = np.cos(pose[:, 2])[:, None], np.sin(pose[:, 2])[:, None]
    north = pose[:, :1] + hull_b[:, 0] * c - hull_b[:, 1] * s
    east = pose[:, 1:2] + hull_b[:, 0] * s + hull_b[:, 1] * c
    return np.stack([east, north], axis=-1)


def hull_polygons(pose: Array, hull_b: Array) -> np.ndarray:
    """(k,) shapely polygons of the hull at each pose."""
    return np.asarray(shapely.polygons(hull_outlines(pose, hull_b)))


def swept_area(pose: Array, hull_b: Array) -> shapely.Geometry:
    """Everything the hull touches between consecutive poses: the union of the pairs' convex hulls."""
    return shapely.union_all(swept_hulls(pose, hull_b))


def swept_hulls(pose: Array, hull_b: Array) -> np.ndarray:
    """(k - 1,) convex hulls of the outlines at consecutive poses (k, 3); the outline itself where there is one pose."""
    corners = hull_outlines(pose, hull_b)
    if len(corners) == 1:
        return np.asarray(shapely.polygons(corners))
    return np.asarray(shapely.convex_hull(shapely.multipoints(np.concatenate([corners[:-1], corners[1:]], axis=1))))


def covering_discs(length_m: float, beam_m: float) -> tuple[Array, float]:
    """Forward positions (3,) and the radius of equal discs on the centre line that cover the hull [m]."""
    piece = length_m / 3
    return np.array([-piece, 0.0, piece]), float(np.hypot(piece / 2, beam_m / 2))


def thinned_poses(pose: Array, *, reach_m: float, spacing_m: float) -> np.ndarray:
    """Indices of poses (k, 3), the last one included: the first after each from which a point may have moved so far.

    Between two of them no point within `reach_m` of the origin moves farther than `spacing_m` and one step more.
    """
    kept = [0]
    for index in range(1, len(pose)):
        moved = np.hypot(*(pose[index, :2] - pose[kept[-1], :2]))
        swung = abs(pose[index, 2] - pose[kept[-1], 2]) * reach_m
        if moved + swung >= spacing_m:
            kept.append(index)
    return np.array([*kept, len(pose) - 1])


def disc_points(pose: Array, centres_m: Array) -> Array:
    """(k, c, 2) north/east of discs at forward positions (c,) on the centre lines of poses (k, 3)."""
    ahead = np.stack([np.cos(pose[:, 2]), np.sin(pose[:, 2])], axis=-1)
    return np.asarray(pose[:, None, :2] + centres_m[:, None] * ahead[:, None, :])


def std_keys(actuators: Sequence[Actuator]) -> tuple[str, ...]:
    """Names of what may have a standard deviation: the faults of sensors, and e.g. "n1_lag_s" of actuator signals."""
    signals = [signal for actuator in actuators for signal in actuator.signals]
    faults = (row.key for row in rows_of(Sensors) if row.is_fault)
    return (*faults, *(f"{signal}_{row.key}" for signal in signals for row in rows_of(Response)))


def response_values(actuators: Sequence[Actuator]) -> dict[str, float]:
    """What actuators state of their responses, by the names of `std_keys`."""
    return {
        f"{signal}_{row.key}": getattr(response, row.key)
        for actuator in actuators
        for signal, response in zip(actuator.signals, actuator.responses, strict=True)
        for row in rows_of(Response)
    }


def with_response_values(actuators: Sequence[Actuator], values: Mapping[str, float]) -> tuple[Actuator, ...]:
    """The actuators with other values of their responses, by the names of `std_keys`."""

    def changed(signal: str, response: Response) -> Response:
        own = {row.key: values.get(f"{signal}_{row.key}") for row in rows_of(Response)}
        return replace(response, **{name: value for name, value in own.items() if value is not None})

    return tuple(
        replace(actuator, responses=tuple(map(changed, actuator.signals, actuator.responses))) for actuator in actuators
    )


@dataclass(frozen=True, kw_only=True)
class Vessel:
    """A ship: particulars, model, sensors and weather."""

    name: str  # for reports
    # length_m, beam_m, draught_m: particulars [m]; the origin of the b-frame is amidships
    length_m: float
    beam_m: float
    draught_m: float
    sample_time_s: float  # time between commands and between measurements [s]
    model: VesselModel  # structure, parameters, actuators
    sensors: Sensors = EXACT  # what they add to the truth
    # weather that came with the model, e.g. from a diagnosis; calm when nothing is known.
    environment: Environment = CALM
    # roll that the motion drives and that does not act back on it; None without [roll]
    pendulum: RollPendulum | None = None
    # standard deviations of what actuators and sensors state, by `std_keys`; known exactly where there is none
    std: Mapping[str, float] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        for name in ("length_m", "beam_m", "draught_m", "sample_time_s"):
            value = getattr(self, name)
            if not 0 < value < np.inf:
                raise InputError(f"vessel.{name} is {value:g}, expected more than 0")
        if self.pendulum is not None and self.model.roll is not None:
            raise InputError("the vessel has roll twice, expected one of [roll] and [model.roll]")
        for name in self.std:
            if name not in std_keys(self.actuators):
                raise UnknownName("standard deviation", name, known=std_keys(self.actuators))
            if name.endswith("_rate") and not np.isfinite(response_values(self.actuators)[name]):
                raise InputError(f"std.{name} is given without a rate, expected the rate in the table of its actuator")

    @property
    def actuators(self) -> tuple[Actuator, ...]:
        """Actuators in command order."""
        return self.model.actuators

    @property
    def limits(self) -> tuple[Limit, ...]:
        """Limits of every actuator signal, in command order."""
        return tuple(limit for actuator in self.actuators for limit in actuator.limits)

    @property
    def responses(self) -> tuple[Response, ...]:
        """How every actuator signal follows its command, in command order."""
        return tuple(response for actuator in self.actuators for response in actuator.responses)

    @property
    def rates(self) -> Array:
        """(m,) slew rate of every actuator signal [unit of the signal per second], in command order."""
        return np.array([response.rate for response in self.responses])

    @property
    def angles(self) -> np.ndarray:
        """(m,) which commands are angles, of azimuths or rudders; the others drive."""
        return np.array([name.startswith(("a", "rudder")) for name in self.model.inputs])

    @property
    def turns_freely(self) -> np.ndarray:
        """(m,) which commands are angles of azimuths without limits, so that whole turns make no difference."""
        names = zip(self.model.inputs, self.limits, strict=True)
        return np.array([name.startswith("a") and not np.isfinite([x.low, x.high]).any() for name, x in names])

    @property
    def hull_b(self) -> Array:
        """(4, 2) corners of the rectangle length x beam, forward/starboard [m]: contains every real waterline."""
        half_length, half_beam = self.length_m / 2, self.beam_m / 2
        return np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * (half_length, half_beam)
