"""Whole adaptive surveys of a simulated point robot: what field models are judged by."""
