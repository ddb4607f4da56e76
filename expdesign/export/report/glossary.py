"""One line for each word of the trade that the report uses."""

from __future__ import annotations

GLOSSARY: tuple[tuple[str, str], ...] = (
    ("Manoeuvre", "a primitive of the dictionary: a short piece of sailing from a stated speed with stated commands"),
    ("Run", "one execution of a manoeuvre; numbered in order on the chart and in the time series"),
    ("Leg", "a stretch of the plan, either a run or repositioning; numbered from 0 as in plan.json and the CSV files"),
    ("Repositioning", "sailing from the end of one run to where the next can begin, at its entry speed and heading"),
    (
        "Information matrix",
        "what the data tells about all parameters together; its inverse is the covariance of their estimates, but for "
        "the noise level",
    ),
    ("Log det", "logarithm of the information matrix's determinant; larger means a smaller region of uncertainty"),
    (
        "D-efficiency",
        "information of one design relative to another, as determinant to the power 1/p for p parameters; at 50 % "
        "the same precision takes twice the time",
    ),
    (
        "Sensitivity",
        "how fast the log det would grow if time were given to a manoeuvre; at the optimum all that are used are equal",
    ),
    (
        "Excitation condition",
        "no velocity inside an absolute value changes sign or comes close to zero; where it holds, noise does not "
        "bias the estimates",
    ),
    ("Clearance", "distance from the hull, as a rectangle, to the nearest water or land that is forbidden"),
    ("u, v, r", "surge speed ahead, sway speed to starboard, and yaw rate to starboard"),
)
