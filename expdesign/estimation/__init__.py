"""Estimation: parameters from measured data, with their uncertainty and what the data cannot tell."""
