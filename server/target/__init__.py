"""Pursuit of targets by range alone: planning it, and telling what becomes of it.

Publishes nothing.
"""
