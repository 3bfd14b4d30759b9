"""The catalogue of vehicles: parameters, polars, and new ones from files.

Publishes nothing.
"""
