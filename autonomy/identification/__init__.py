"""Finds a vehicle's parameters and trim in what it recorded."""
