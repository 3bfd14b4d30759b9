"""The search for the best trajectory: growth, refinement and the ergodic measure."""
