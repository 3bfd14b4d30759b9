"""The catalogue of vehicles, and how each of them moves."""
