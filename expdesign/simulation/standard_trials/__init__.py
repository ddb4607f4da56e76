"""Standard trials: turning circle, zig-zag, pull-out, stop, carried out by a simulated helmsman."""

from expdesign.simulation.standard_trials.helmsman import Conduct
from expdesign.simulation.standard_trials.trials import pull_out, stopping, turning_circle, zigzag

__all__ = ["Conduct", "pull_out", "stopping", "turning_circle", "zigzag"]
