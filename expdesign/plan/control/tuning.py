"""The numbers of this room that are chosen, not derived."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, kw_only=True)
class Tuning:
    """Capability, controllers and tracking.

    Attributes:
        usable_share: of the largest steady speed, and of the largest steady yaw rate, that repositioning counts on.
        lateral_mps2: lateral acceleration of turns on legs: small enough not to heel the ship.
        settling_share: of the time in which a vessel reaches its speed, or its actuators run up, that a change of
            motion takes besides.
        helm_overshoot: largest yaw rate on the way into a turn, in those of the steady one: a rule of thumb that bounds
            the search.
        helm_share: of the hardest helm at which ships turn on legs: the rest is for getting into turns and out of them.
        helm_slow_share: slowest speed, in transit speeds, at which a ship must still turn as tightly as legs ask.
        full_ahead_hulls: hull lengths at transit speed in whose time full ahead from rest is simulated.
        approach_hulls: hull lengths that a helm-steered ship goes straight and steady before each run.
        settling_hulls: hull lengths before that in which what is left of a turn dies out.
        agile_path_spares: hull lengths that paths of agile ships keep from the shore beyond clearance and half beam.
        catch_up: largest speed towards the reference, in transit speeds.
        track_lead: time constant of the return to the reference, in those of the velocities.
        pace_least, pace_most: of a reference that stays abeam of a ship, in samples.
        lead_share: share of their lag in which lagging actuators reach what is desired, by commanding more.
        learning: time constant in which an unexplained acceleration is estimated, in those of the velocities.
        run_up_time_constants: of the return to the track, that the run-up of a force-steered ship lasts.
        helm_run_up_hulls: hull lengths of the run-up of a helm-steered ship.
        course_frequency, course_damping: natural frequency of courses in that of a hull length at transit speed, and
            their damping.
        helm_slowest: speed, in transit speeds, below which the helm is not taken to have less effect.
        helm_farthest_rad: change of course that the helm answers to at most.
        helm_angles: to each side, whose steady turns are simulated.
        steady_hulls: hull lengths at approach speed after which a turn counts as steady.
        steady_share: of the approach speed, per time of a hull length, that a steady turn may still gain or lose.
        steady_offset: shares of the approach's scales between the exact turn and the end of its simulation.
        speed_bands: with a largest acceleration each.
        stage_shares: of the time in which actuators get from nothing to full; until then they reach only so far.
        drawn_motions: motions and commands drawn for each band and stage.
        refinements, refined_motions: rounds in which the best of them are varied, and how many are.
        rate_margin: factor on the largest rates found, for what the search may have missed.
        loss_step, loss_steps: step of time, in the actuators' time from nothing to full, and their largest number.
    """

    usable_share: float = 0.9
    lateral_mps2: float = 0.03 * 9.81
    settling_share: float = 0.25
    helm_overshoot: float = 1.3
    helm_share: float = 0.65
    helm_slow_share: float = 0.5
    full_ahead_hulls: float = 200.0
    approach_hulls: float = 1.0
    settling_hulls: float = 2.0
    agile_path_spares: tuple[float, ...] = (0.25, 0.1, 0.02)
    catch_up: float = 0.3
    track_lead: float = 4.0
    pace_least: float = 0.2
    pace_most: float = 3.0
    lead_share: float = 0.2
    learning: float = 3.0
    run_up_time_constants: float = 3.0
    helm_run_up_hulls: float = 8.0
    course_frequency: float = 1.2
    course_damping: float = 0.9
    helm_slowest: float = 0.3
    helm_farthest_rad: float = 1.0
    helm_angles: int = 8
    steady_hulls: float = 30.0
    steady_share: float = 1e-6
    steady_offset: float = 0.3
    speed_bands: int = 12
    stage_shares: tuple[float, ...] = (0.1, 0.2, 0.35, 0.6, 1.0)
    drawn_motions: int = 240
    refinements: int = 5
    refined_motions: int = 12
    rate_margin: float = 1.1
    loss_step: float = 0.01
    loss_steps: int = 3000


CONTROL = Tuning()
