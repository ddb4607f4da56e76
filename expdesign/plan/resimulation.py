"""The commands of a plan simulated anew, in one piece where that reproduces the track, else in stretches.

Of a ship that is unstable on her course the smallest difference grows without bound, so that no simulation of a long
trial agrees with another. Such a track is checked in stretches (as in multiple shooting): each begins where the track
is, and the errors at their ends add up, each with what it moves a ship by later: a heading by the distance from there,
a speed by what it makes in a stretch, in which it dies out. A stable ship would be no farther off as a whole, so that
of a track which passes in stretches alone the ship is unstable.

Source: H. G. Bock and K. J. Plitt, IFAC Proc. 17 (1984), 1603-1608, for the stretches.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from expdesign.plan.values import SailedTrial
from expdesign.signals import Trajectory
from expdesign.simulation import Environment, deliver, integrate_motion, simulate, step_shares
from expdesign.simulation.environment import weather_rows
from expdesign.simulation.run import SUBSTEPS, rolled
from expdesign.values import Array
from expdesign.vessel import Vessel

FINE_SUBSTEPS = 10 * SUBSTEPS  # integrator steps per sample: ten times as many as in planning
STRETCH_HULLS = (10.0, 3.0)  # lengths of stretches that are tried, in hull lengths at transit speed
# off the track, beyond which motion is not that of the commands: hull lengths, radians, shares of the largest speeds
OFF_HULLS, OFF_RAD, OFF_SPEED = 1.0 / 30.0, 0.02, 0.02


@dataclass(frozen=True, kw_only=True, eq=False)
class Resimulation:
    """The motion of commands beside a track."""

    track: Trajectory  # as planned
    motion: Trajectory  # as simulated anew
    stretch: int | None = None  # samples after which it begins anew on the track; None where it does not

    @property
    def off_m(self) -> Array:
        """(k + 1,) distances; in stretches those at the ends of earlier ones too, and what they lead to later [m]."""
        place = self.track.pose[:, :2]
        off_m = np.hypot(*(self.motion.pose[:, :2] - place).T)
        if self.stretch is None:
            return np.asarray(off_m)
        fastest = float(np.hypot(*self.motion.velocity[:, :2].T).max())
        lost_m = self._off_speed * fastest * self.stretch * self.track.sample_time_s
        total = off_m.copy()
        for end in range(self.stretch, len(off_m), self.stretch):
            away_m = np.hypot(*(place[end + 1 :] - place[end]).T)
            total[end + 1 :] += off_m[end] + lost_m[end] + self._off_rad[end] * away_m
        return np.asarray(total)

    @property
    def off_rad(self) -> Array:
        """(k + 1,) differences of heading, with those at the ends of earlier stretches [rad]."""
        return self._summed(self._off_rad)

    @property
    def off_speed(self) -> Array:
        """(k + 1,) largest differences of velocity in the largest of each, summed alike."""
        return self._summed(self._off_speed)

    def problems(self, hull_m: float) -> tuple[str, ...]:
        """Where the track is not the motion that the commands give."""
        found = (
            ("m", self.off_m, OFF_HULLS * hull_m),
            ("rad of heading", self.off_rad, OFF_RAD),
            ("of the largest speed", self.off_speed, OFF_SPEED),
        )
        return tuple(
            f"the re-simulated commands are {off.max():.3g} {what} off the track at "
            f"{np.argmax(off) * self.track.sample_time_s:.0f} s, allowed {allowed:.3g}"
            for what, off, allowed in found
            if not off.max() <= allowed
        )

    @property
    def _off_rad(self) -> Array:
        return np.asarray(np.abs(self.motion.pose[:, 2] - self.track.pose[:, 2]))

    @property
    def _off_speed(self) -> Array:
        largest = np.abs(self.motion.velocity).max(axis=0) + 1e-9
        return np.asarray((np.abs(self.motion.velocity - self.track.velocity) / largest).max(axis=1))

    def _summed(self, off: Array) -> Array:
        """(k + 1,) errors, with those at the ends of earlier stretches."""
        if self.stretch is None:
            return off
        ends = np.zeros(len(off))
        ends[self.stretch :: self.stretch] = off[self.stretch :: self.stretch]
        return np.asarray(off + np.cumsum(ends) - ends)


def resimulated(vessel: Vessel, environment: Environment, sailed: SailedTrial, *, transit_mps: float) -> Resimulation:
    """The commands simulated ten times finer, in stretches where the whole does not reproduce the track.

    A model with a roll mode is simulated as a whole in any case: where its roll is, the track does not say.
    """
    track = sailed.trajectory
    whole = simulate(
        vessel,
        sailed.commands,
        pose=track.pose[0],
        velocity=track.velocity[0],
        environment=environment,
        substeps=FINE_SUBSTEPS,
    )
    found = Resimulation(track=track, motion=whole)
    if vessel.model.roll is not None or not found.problems(vessel.length_m):
        return found
    for hulls in STRETCH_HULLS:
        stretch = max(1, round(hulls * vessel.length_m / transit_mps / track.sample_time_s))
        pieces = Resimulation(track=track, motion=_in_stretches(vessel, environment, sailed, stretch), stretch=stretch)
        if not pieces.problems(vessel.length_m):
            return pieces
    return found


def _in_stretches(vessel: Vessel, environment: Environment, sailed: SailedTrial, stretch: int) -> Trajectory:
    """The motion, begun anew on the track after so many samples; at these it is where the stretch before ends."""
    commands, track = sailed.commands, sailed.trajectory
    step_s = commands.sample_time_s
    shares = step_shares(vessel.responses, sample_time_s=step_s, substeps=FINE_SUBSTEPS)
    given = deliver(vessel.responses, commands.values, sample_time_s=step_s, substeps=shares)
    sea = np.concatenate(weather_rows(environment, len(commands)), axis=1)
    states = np.column_stack([track.pose, track.velocity])
    motion = states.copy()
    for first in range(0, len(commands), stretch):
        part = slice(first, min(first + stretch, len(commands)))
        moved = integrate_motion(
            vessel, given[part], states[first], sea=sea[part], sample_time_s=step_s, substeps=shares
        )
        motion[part.start + 1 : part.stop + 1] = moved[1:]
    return Trajectory(
        sample_time_s=step_s,
        pose=motion[:, :3],
        velocity=motion[:, 3:],
        auxiliary=rolled(vessel, motion, commands, sea),
    )
