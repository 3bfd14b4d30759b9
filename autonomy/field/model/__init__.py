"""Gaussian processes over several fidelities, and the algebra that they stand on."""
