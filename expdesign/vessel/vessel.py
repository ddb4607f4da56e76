"""The vessel: particulars, hull outline, model, sensors and the weather it was found in."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace

import numpy as np

from expdesign.errors import InputError, UnknownName
from expdesign.values import Array
from expdesign.vessel.actuators import Actuator, Limit, Response
from expdesign.vessel.environment import CALM, Environment
from expdesign.vessel.model import VesselModel
from expdesign.vessel.roll import RollPendulum
from expdesign.vessel.sensors import EXACT, FAULTS, Sensors


def std_keys(actuators: Sequence[Actuator]) -> tuple[str, ...]:
    """Names of what may have a standard deviation: the faults of sensors, and e.g. "n1_lag_s" of actuator signals."""
    signals = [signal for actuator in actuators for signal in actuator.signals]
    return (*FAULTS, *(f"{signal}_{field.name}" for signal in signals for field in fields(Response)))


def response_values(actuators: Sequence[Actuator]) -> dict[str, float]:
    """What actuators state of their responses, by the names of `std_keys`."""
    return {
        f"{signal}_{field.name}": getattr(response, field.name)
        for actuator in actuators
        for signal, response in zip(actuator.signals, actuator.responses, strict=True)
        for field in fields(Response)
    }


def with_response_values(actuators: Sequence[Actuator], values: Mapping[str, float]) -> tuple[Actuator, ...]:
    """The actuators with other values of their responses, by the names of `std_keys`."""

    def changed(signal: str, response: Response) -> Response:
        own = {field.name: values.get(f"{signal}_{field.name}") for field in fields(Response)}
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
