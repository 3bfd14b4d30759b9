"""Robots that do not exist: plant, sensors, onboard program and emulated radios."""
