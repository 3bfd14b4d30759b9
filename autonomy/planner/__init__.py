"""The informative planner: primitives, energy, and the search for the best trajectory."""
