"""Batches simulated again: instruments, and fast simulation for output error."""

from expdesign.estimation.replay.instruments import InstrumentModel, apart_from_start, instrument_wind
from expdesign.estimation.replay.replay import Integration, build_replay, simulate_batch
from expdesign.estimation.replay.stretches import Compiled, Stretches, compiled

__all__ = [
    "Compiled",
    "InstrumentModel",
    "Integration",
    "Stretches",
    "apart_from_start",
    "build_replay",
    "compiled",
    "instrument_wind",
    "simulate_batch",
]
