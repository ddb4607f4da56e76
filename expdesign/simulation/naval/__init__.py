"""A multipurpose naval vessel with two podded drives in four degrees of freedom: surge, sway, roll, yaw.

It is a truth to simulate, for trials of models that are simpler; vessel files cannot name it, as roll and pods in
oblique flow are not linear in parameters. What becomes of it in vessel files: the coupling of sway and yaw is
`[model.inertia]`, roll is the linear mode of `[model.roll]`, and everything in u, v, r is `[[model.terms]]`. Its yaw
equation is the yaw model of `expdesign monitor`, which reads roll and the drives' moment from the data.

Frames: b-frame x forward, y to starboard, z down; roll positive to starboard, yaw clockwise. A positive pod angle
pushes the stern to starboard, so that the ship turns to port.

Sources: M. Blanke and A. Christensen (1993) and T. Perez, Ship Motion Control (2005), for hull and coefficients;
W. Gierusz (2015), simplified, for the pods; both as listed in a master's thesis on the estimation of a ship's yaw
dynamics in operation. Where its text and tables disagree, the sign that obeys Newton's law was taken: -C(nu) nu.
"""

from expdesign.simulation.naval.hull import NOMINAL, Hull
from expdesign.simulation.naval.motion import STATES, Voyage, sail, sail_many
from expdesign.simulation.naval.pods import Pods, pod_force

__all__ = ["NOMINAL", "STATES", "Hull", "Pods", "Voyage", "pod_force", "sail", "sail_many"]
