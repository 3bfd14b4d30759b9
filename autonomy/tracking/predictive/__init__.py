"""Predictive control of the distance to a target, the pursuit law's alternative."""
