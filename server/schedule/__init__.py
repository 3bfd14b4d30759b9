"""Plans that the station sends by itself: at the next surfacing, at a time, or on a condition.

Each is a row before anything is due, has an expiry, and can be cancelled. Nothing is sent late.
"""
