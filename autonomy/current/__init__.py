"""Currents as knowledge: the flow of a water from what the fixes of its robots reveal."""
