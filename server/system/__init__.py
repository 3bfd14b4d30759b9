"""The station itself: health, settings, events, jobs, the live stream and the documentation.

Publishes nothing.
"""
