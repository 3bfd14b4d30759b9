"""The thesis's planner to the letter: the oracle of the search."""
