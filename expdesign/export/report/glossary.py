"""Technical terms of the report, one line each."""

from __future__ import annotations

GLOSSARY: tuple[tuple[str, str], ...] = (
    ("Manoeuvre", "a primitive of the dictionary: a short motion with stated commands from a stated initial velocity"),
    ("Run", "one execution of a manoeuvre; numbered on the chart and in the time series"),
    (
        "Leg",
        "a part of the plan, either a run or a repositioning leg; numbered from 0 as in plan.json and the CSV files",
    ),
    ("Repositioning", "the transit from the end of one run to the start of the next, at its initial speed and heading"),
    (
        "Information matrix",
        "information of the data about all parameters; its inverse is the covariance of the estimates, up to the noise "
        "variance",
    ),
    ("Log det", "logarithm of the determinant of the information matrix; larger means a smaller confidence region"),
    (
        "D-efficiency",
        "ratio of two information determinants, to the power 1/p for p parameters; at 50 % the same accuracy takes "
        "twice the time",
    ),
    (
        "Sensitivity",
        "derivative of the log det with respect to the time of a manoeuvre; at the optimum equal for all used ones",
    ),
    (
        "Excitation condition",
        "no velocity inside an absolute value changes sign or comes close to zero; then noise does not bias "
        "instrumental-variable estimates",
    ),
    ("Clearance", "distance from the rectangular hull to the nearest forbidden water or land"),
    ("u, v, r", "surge speed ahead, sway speed to starboard, and yaw rate to starboard"),
)
