"""Robots that do not exist: plant, sensors and emulated radios."""
