"""The equations of motion in matrix form: the oracle of the compiled model."""
