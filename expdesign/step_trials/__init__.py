"""Step trials: steady states and transients of throttle and rudder steps, and the models that follow from them.

U is the speed over ground [m/s], r the yaw rate [rad/s], positive to starboard. Commands have the units of their
signals (rps, rad); an inertia is a command per acceleration. Times are in seconds from the change of command.

Source: B.-O. H. Eriksen and M. Breivik, Modeling, identification and control of high-speed ASVs: theory and
experiments, in Sensing and Control for Autonomous Vehicles (2017); S. Cao and R. R. Rhinehart, J. Process Control 5
(1995).
"""

from expdesign.step_trials.holds import CHANNELS, Controls, Sailed, ahead_only, controls_of, levels_of, sailed
from expdesign.step_trials.identify import StepTrial, identify_steps
from expdesign.step_trials.nominal import nominal_vessel, with_delays
from expdesign.step_trials.samples import StepSample
from expdesign.step_trials.surfaces import NO_BEND, Surface
