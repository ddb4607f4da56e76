"""Batches simulated again: instruments, and fast simulation for output error."""

from expdesign.estimation.replay.instruments import (
    LEAVE_OUT,
    PLANNED,
    STEERED,
    InstrumentModel,
    Steered,
    apart_from_start,
    as_planned,
    instrument_wind,
    open_loop,
    treatment_of,
)
from expdesign.estimation.replay.replay import (
    Compiled,
    Integration,
    Replay,
    Stretches,
    build_replay,
    compiled,
    simulate_batch,
)
