"""Talking to robots: transports, protocols, sessions, mission transfer."""
