"""Roll of measured records: their runs, and whether a ship still rolls as her file says."""

from expdesign.roll.record.batch import NEEDED, missing_columns, planned_everywhere, roll_run, with_one_source
from expdesign.roll.record.judge import ALARM_P, CAUSES, LOAD, RollChange, RollJudgement, judge_roll, record_estimate

__all__ = [
    "ALARM_P",
    "CAUSES",
    "LOAD",
    "NEEDED",
    "RollChange",
    "RollJudgement",
    "judge_roll",
    "missing_columns",
    "planned_everywhere",
    "record_estimate",
    "roll_run",
    "with_one_source",
]
