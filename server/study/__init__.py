"""Studies of vehicles: what-if runs, identification, trim."""
