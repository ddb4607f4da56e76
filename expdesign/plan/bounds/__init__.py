"""Lower bounds on repositioning time that hold for every plan."""

from expdesign.plan.bounds.displacement import Headway
from expdesign.plan.bounds.repositioning import cheapest_orders, place_values, reposition_bound_s, time_to_sail_s
