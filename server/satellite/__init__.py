"""Talking to robots by satellite: every byte costs, every answer takes a surfacing or more."""
