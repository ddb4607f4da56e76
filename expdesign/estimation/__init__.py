"""Estimation: parameters from measured data, their uncertainty, and the parameters that data cannot determine."""
