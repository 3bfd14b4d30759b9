"""Deployments: the stretches of time that robots spend in the water, and who says when.

Above ``server.fleet``, which knows of each robot whether it is in the water or in the workshop.
"""
