"""Adaptive surveys: missions whose rounds are planned, flown and mapped."""
