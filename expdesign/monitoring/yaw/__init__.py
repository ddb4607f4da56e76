"""Yaw dynamics from operational data: models with measured surge, sway, roll and drive moment as inputs.

    found = estimate_yaw(YAW_MODELS["full"], data, start_values(YAW_MODELS["full"], data))
    found.parameters, found.fit
    ship, notes = learnt_ship(YAW_MODELS["full"], vessel.model, reference, stretch_s=60.0)      to be watched

The model is simulated, yaw rate is its only state; parameters minimise the squared error of the yaw rate (output
error). All inputs are measured, and their noise is a bias that output error does not remove; instruments do, which is
beyond the thesis.

Source: a master's thesis on the estimation of a ship's yaw dynamics in operation, chapters 2 to 6.
"""

from expdesign.monitoring.yaw.estimate import estimate_yaw, halves_differ, simulate_yaw, start_values
from expdesign.monitoring.yaw.learnt import estimate_yaw_by_instruments, halves_in_words, learnt_ship
from expdesign.monitoring.yaw.model import YAW_MODELS, YawData, YawModel, needed_columns, term_budget
from expdesign.monitoring.yaw.ship import KEY, YawShip, ship_of_changes, yaw_changes, yaw_grams
