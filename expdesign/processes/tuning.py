"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Patience with a cluster.

    Attributes:
        connect_s: in which a scheduler must answer at first, and again after the connection broke.
        look_s: without a finished task, after which the scheduler is asked whether it and its workers are there.
        answer_s: in which it must answer then.
        idle_s: after which work without any worker is given up; workers that died are mostly started again sooner.
    """

    connect_s: float = 4.0
    look_s: float = 5.0
    answer_s: float = 20.0
    idle_s: float = 60.0


CLUSTER = Tuning()


@dataclass(frozen=True, kw_only=True)
class Reporting:
    """How closely tasks in other processes are followed.

    Attributes:
        look_s: between two looks at their reports.
    """

    look_s: float = 0.2


REPORTING = Reporting()
