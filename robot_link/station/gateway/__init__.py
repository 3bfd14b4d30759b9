"""Satellite gateways on the ground: how bytes get to a robot's modem, and how its own come back."""
