"""What a watch knows between two stretches, the alarms it raises and the rules it keeps."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from expdesign.monitoring.calibration import Calibration
from expdesign.monitoring.evidence import KINDS
from expdesign.monitoring.force import Judged, Known, beside
from expdesign.values import Array


@dataclass(frozen=True, kw_only=True)
class Alarm:
    """A change that was noticed."""

    time_s: float  # when the sum passed its threshold [s]
    since_s: float  # when that sum began, the estimate of when the change happened [s]
    statistic: float  # the sum, a log-likelihood ratio, when the alarm was raised
    change: int  # number of the change that explains the data since then best
    # value, std: its estimate in sizes, and the standard error
    value: float = 0.0
    std: float = 0.0
    as_likely: tuple[int, ...] = ()  # numbers of other changes that explain them as well, best first
    # steady accelerations since then, of the modelled ones of surge, sway and yaw by number, that explain them as well
    # without a change of the ship, each with its log-likelihood over that of the change
    pushes: tuple[tuple[int, float], ...] = ()
    # another load since then, as much more inertia in every equation, where it explains them as well: its
    # log-likelihood over that of the change, its size and the standard error
    loaded: tuple[float, float, float] | None = None
    unexplained: float = 0.0  # log-likelihood that all changes together gain beyond the best one
    named: bool = False  # the change was named, and its size is being refined
    settled: bool = False  # its size, too, is as sure as it is going to be, and the watch goes on from the changed ship
    # the data that followed say that it is over or was none, before its size was settled
    withdrawn: bool = False
    judged_s: float = 0.0  # end of the data that the estimate is from [s]


@dataclass(frozen=True, kw_only=True, eq=False)
class Sums:
    """What was added up since n beginnings."""

    since_s: Array  # (n,) the beginnings [s]
    taken: Array  # (n, f, m) what the filter has taken of each change for the unmeasured force and the load
    # score, information: (n, m) and (n, m, m)
    score: Array
    information: Array
    squares: Array  # (n, m) sum of each score's square over its information
    stretches: Array  # (n,) that were added
    rougher: Array  # (n, a) `State.rougher` before the first of them
    # known_s: (n,) when what was known of the force and the load before the first was known [s], infinite where it
    # was of another ship; mean, covariance: (n, f) and (n, f, f), as in `Known`
    known_s: Array
    known_heading: Array  # (n,) heading then [rad], nan where it is not known
    mean: Array
    covariance: Array

    @property
    def count(self) -> int:
        """Stretches since the first beginning."""
        return int(self.stretches[0])

    @classmethod
    def begun(
        cls, count: int, changes: int, known: Known, time_s: float, rougher: Array, heading: float = math.nan
    ) -> Sums:
        """Nothing yet."""
        return cls(
            since_s=np.full(count, time_s),
            taken=np.zeros((count, len(known.mean), changes)),
            score=np.zeros((count, changes)),
            information=np.zeros((count, changes, changes)),
            squares=np.zeros((count, changes)),
            stretches=np.zeros(count),
            rougher=np.tile(rougher, (count, 1)),
            known_s=np.full(count, time_s),
            known_heading=np.full(count, heading),
            mean=np.tile(known.mean, (count, 1)),
            covariance=np.tile(known.covariance, (count, 1, 1)),
        )

    def one(self, place: int) -> Sums:
        """Those of one beginning."""
        return Sums(**{name: values[place : place + 1] for name, values in vars(self).items()})

    def again(self, places: np.ndarray, state: State) -> Sums:
        """The sums with some (n,) begun anew at a state."""
        count, changes = self.score.shape
        begun = Sums.begun(count, changes, state.known, state.until_s, state.rougher, state.heading)
        return self._where(places, begun)

    def first(self, places: np.ndarray, one: Judged, time_s: float, before: State) -> Sums:
        """The sums with some (n,) begun with a stretch at a time, before which the state was another."""
        begun = Sums(
            since_s=np.array([time_s]),
            taken=(one.gain @ one.seen[0])[None],
            score=one.score[None],
            information=one.information[None],
            squares=_squares(one.score[None], one.information[None]),
            stretches=np.ones(1),
            rougher=before.rougher[None],
            known_s=np.array([before.until_s]),
            known_heading=np.array([before.heading]),
            mean=before.known.mean[None],
            covariance=before.known.covariance[None],
        )
        return self._where(places, begun)

    def less(self, change: Array) -> Sums:
        """The sums with a change (m,) moved into the ship's model, and stretches counted anew."""
        return replace(self, score=self.score - self.information @ change, stretches=np.zeros(len(self.stretches)))

    def _where(self, places: np.ndarray, other: Sums) -> Sums:
        return Sums(
            **{
                name: np.where(places.reshape(-1, *[1] * (values.ndim - 1)), getattr(other, name), values)
                for name, values in vars(self).items()
            }
        )

    def later(self, keep: Array) -> Sums:
        """The sums after a gap over which the force's autocorrelation is (f,)."""
        return replace(self, taken=keep[:, None] * self.taken)

    def begun_by(self, time_s: float) -> Sums:
        """The sums, those that hold nothing yet from a time on [s]."""
        empty = ~self.information.any(axis=(1, 2))
        return replace(self, since_s=np.where(empty, time_s, self.since_s))

    def unjudged(self, one: Judged) -> Sums:
        """The sums after a stretch that the force is learnt from alone."""
        return replace(self, taken=beside(one, self.taken)[2])

    def added(self, one: Judged) -> tuple[Sums, Array, Array]:
        """The sums with one more stretch; and its scores (n, m) and information (n, m, m)."""
        score, information, taken = beside(one, self.taken)
        after = replace(
            self,
            taken=taken,
            score=self.score + score,
            information=self.information + information,
            squares=self.squares + _squares(score, information),
            stretches=self.stretches + 1.0,
        )
        return after, score, information


def _squares(score: Array, information: Array) -> Array:
    """(n, m) of `Sums`, of one stretch."""
    known = np.einsum("nmm->nm", information)
    return np.asarray(np.where(known > 0, score**2 / np.maximum(known, 1e-300), 0.0))


@dataclass(frozen=True, kw_only=True, eq=False)
class Load:
    """What the ship carries since a port call, or since the watch began."""

    since_s: float  # end of the port call [s]
    stay_s: float  # time in port [s]; zero where the watch began
    judged: int  # stretches since then
    rounds: int  # how often it was taken for the ship's
    taken: Array  # (m,) changes that were, in sizes, less what the filter held before the call


@dataclass(frozen=True, kw_only=True, eq=False)
class Call:
    """A port call whose load was estimated."""

    time_s: float  # its end [s]
    stay_s: float  # its length [s]
    # value, std: (m,) what it changed, in sizes, and the standard errors
    value: Array
    std: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Budget:
    """What terms contributed and what was told, by kind of stretch."""

    stretches: Array  # (k,) that were judged or left out for their weather, for each of `KINDS`
    duration_s: Array  # (k,) of them [s]
    terms: Array  # (k, m, 3) sums of their `Grams.budget`
    information: Array  # (k, m) sums of the information about every change, in inverse squared sizes

    @classmethod
    def begun(cls, changes: int) -> Budget:
        """Nothing yet."""
        kinds = len(KINDS)
        return cls(
            stretches=np.zeros(kinds), duration_s=np.zeros(kinds), terms=np.zeros((kinds, changes, 3)),
            information=np.zeros((kinds, changes)),
        )  # fmt: skip

    def added(self, kind: int, duration_s: float, terms: Array, information: Array) -> Budget:
        """The budget with a stretch added."""
        where = np.arange(len(self.stretches)) == kind
        return Budget(
            stretches=self.stretches + where,
            duration_s=self.duration_s + duration_s * where,
            terms=self.terms + where[:, None, None] * terms,
            information=self.information + where[:, None] * information,
        )


@dataclass(frozen=True, kw_only=True, eq=False)
class State:
    """State of a watch between two stretches."""

    until_s: float  # end of the last stretch that was looked at [s]
    known: Known  # of the unmeasured force and the load, then
    ratios: Array  # (2 m,) sums of log-likelihood ratios, of increases and then of decreases
    peaks: Array  # (2 m,) the largest of each since it began
    sums: Sums  # since they began, 2 m of them
    shift: Array  # (m,) changes of the ship that were found, in sizes; before: the same before the last alarm
    before: Array
    whole: Sums  # sums since the watch began, or since the last change was settled
    load: Load  # since the last port call; calls: those before, the latest of them
    budget: Budget  # of the stretches judged
    rough: Known  # as `known`, in each of the (a,) other weathers of the calibration
    rougher: Array  # (a,) log-likelihood of the data so far in these, beyond that in the reference's
    weather: Array  # (m,) of late, the `surprise` of stretches for every change, in that of the reference
    beyond_of_s: Array
    heading: float = math.nan  # of the last stretch that was looked at [rad], nan where it is not known
    calls: tuple[Call, ...] = ()
    alarm: Alarm | None = None  # the alarm that is not yet settled, or None; pending: sums since its change
    pending: Sums | None = None
    # judged_s, left_out_s: measured time of the stretches that were judged, and of those whose error or weather was
    # beyond the reference for every change [s]; beyond_of_s: (m,) the first, where it was so for one change [s]
    judged_s: float = 0.0
    left_out_s: float = 0.0
    # the latest of that left out for its weather; a change that is noticed may explain it yet [s]
    beyond_s: float = 0.0
    # shoal_s, shoalest: that left out for water shallower than in the reference [s], and draught over depth there
    shoal_s: float = 0.0
    shoalest: float = 0.0
    # wind_s, windiest_mps: that left out for wind unlike the reference's [s], and the largest mean speed of the air
    # past the ship there [m/s]
    wind_s: float = 0.0
    windiest_mps: float = 0.0
    undecided_s: float = 0.0  # how long the largest sum has been above the threshold and too short to be judged [s]
    # brief, by_weather: how often such a sum fell again, and how often weather explained one that was judged
    brief: int = 0
    by_weather: int = 0

    @classmethod
    def begun(cls, calibration: Calibration, *, time_s: float) -> State:
        """The state at the beginning of a watch."""
        m, known = len(calibration.baseline), calibration.begun(calibration.nuisance)
        rough, rougher = calibration.begun(calibration.others), np.zeros(len(calibration.seas.variance))
        return cls(
            until_s=time_s,
            known=known,
            rough=rough,
            rougher=rougher,
            ratios=np.zeros(2 * m),
            peaks=np.zeros(2 * m),
            sums=Sums.begun(2 * m, m, known, time_s, rougher),
            shift=np.zeros(m),
            before=np.zeros(m),
            whole=Sums.begun(1, m, known, time_s, rougher),
            load=Load(since_s=time_s, stay_s=0.0, judged=0, rounds=0, taken=np.zeros(m)),
            budget=Budget.begun(m),
            weather=np.ones(m),
            beyond_of_s=np.zeros(m),
        )

    def with_known(self, known: Known) -> State:
        """The state with other knowledge of force and load, from which the other weathers go on, too."""
        return replace(self, known=known, rough=known.repeated(len(self.rougher)))


@dataclass(frozen=True, kw_only=True)
class Rules:
    """When an alarm is raised, and what counts as a port call."""

    limit: float  # threshold of the sums
    port_s: float = math.inf  # time without a stretch under way from which the ship may carry another load [s]


@dataclass(frozen=True, kw_only=True)
class Step:
    """Outcome of one stretch."""

    time_s: float  # its end [s]
    statistic: float  # the largest of all sums
    change: int  # whose
    # whether it is compared with the threshold: not where it is above and too short to tell a change of the ship from
    # weather, or where weather explains it
    compared: bool = True
