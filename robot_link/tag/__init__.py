"""Acoustic tags of animals: what a receiver on board says of them, and what a robot passes on."""
