"""Manoeuvre families, in one visible tuple; adding one is a function and its name here."""

from expdesign.dictionary.families import motions, orders, step_trials

FAMILIES = (
    motions.acceleration,
    motions.deceleration,
    motions.zigzag,
    motions.turning_circle,
    motions.inward_spiral,
    motions.sway_zigzag,
    motions.sway_step,
    motions.telegraph,
    motions.multisine,
    orders.crash_stop,
    orders.turning_circle_helm,
    orders.zigzag_heading,
    orders.pull_out,
    orders.dieudonne_spiral,
    orders.steps,
    step_trials.throttle_steps,
    step_trials.rudder_steps,
    step_trials.helm_and_engine_waves,
    orders.recorded,
)
