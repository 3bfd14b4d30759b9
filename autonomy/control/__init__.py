"""Controllers that track a reference trajectory."""
