"""Flies one plan: maneuvers, guidance, navigation, safety."""
