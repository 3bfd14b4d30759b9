"""Flights that are known exactly, and every estimator judged on them."""
