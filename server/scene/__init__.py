"""Robots, plans and maps in three dimensions; shows, and changes nothing.

Publishes nothing.
"""
