"""Missions flown ahead by compiled code: onboard program and simulated robot as one kernel."""
