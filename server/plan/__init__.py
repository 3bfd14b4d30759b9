"""Plans: made, checked, flown ahead, and moved from state to state."""
