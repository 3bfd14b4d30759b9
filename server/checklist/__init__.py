"""Checklists: what is looked at before a dive, before a launch, each day and at recovery.

What robots tell fills the automatic items, people tick the others by name; a start waits for both.
"""
