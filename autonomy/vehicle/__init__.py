"""Dynamics of the glider: parameters, equations of motion, steady glides."""
