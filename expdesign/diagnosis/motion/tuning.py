"""Numbers that steer simulations."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Numbers of this room.

    Attributes:
        largest_speed: state beyond which a simulation has diverged [m/s, rad/s].
        difference: step of finite differences of the rates by the state.
        samples_at_once: of all windows whose rates are differentiated at once, at most: small arrays cost their number,
            large ones leave the processor's cache.
        actuator_substeps: parts of an integrator step in which moving actuators are followed, at least; forces are not
            linear in angles.
        roll_angle_rad: of a roll oscillation in one part of an integrator step, at most.
        most_roll_parts: parts of an integrator step for roll.
        newton_rounds: of a simulation of all steps at once.
        newton_divergence: growth of the correction that counts as divergence.
        newton_refresh: correction above which the transition matrices are updated.
        newton_tolerance: correction below which it has converged.
        newton_safety: share of the tolerance below which the next correction must lie not to be made.
        start_samples: samples that measured initial states are estimated from.
        fewest_start_samples: of them that are measured, for a state to be fitted to them.
        fewest_windows: into which data are cut.
        window_rounds: of shortening the windows of an unstable model.
        fewest_window_samples: of shortened windows.
        largest_growth: of an error of the initial state within a window.
    """

    largest_speed: float = 60.0
    difference: float = 1e-5
    samples_at_once: int = 16_000
    actuator_substeps: int = 4
    roll_angle_rad: float = 0.25
    most_roll_parts: int = 16
    newton_rounds: int = 12
    newton_divergence: float = 5.0
    newton_refresh: float = 3e-3
    newton_tolerance: float = 1e-8
    newton_safety: float = 0.1
    start_samples: int = 5
    fewest_start_samples: int = 3
    fewest_windows: int = 4
    window_rounds: int = 4
    fewest_window_samples: int = 30
    largest_growth: float = 6.0


TUNING = Tuning()
