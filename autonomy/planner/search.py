"""The planner that the station runs."""

from autonomy.planner.literal import plan

__all__ = ["plan"]
