"""Legs between two surfacings: primitives, the way that they take, and drift."""
