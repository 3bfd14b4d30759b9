"""Missions of several rounds, which plan, fly and map until their budget is spent.

The bus is told ``MissionChanged``.
"""
