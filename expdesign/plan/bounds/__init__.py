"""Lower bounds on repositioning time that hold for every plan."""

from expdesign.plan.bounds.cheapest_orders import cheapest_orders, place_values
from expdesign.plan.bounds.repositioning import reposition_bound_s

__all__ = ["cheapest_orders", "place_values", "reposition_bound_s"]
