"""Driving a robot by hand: one person at a time, by radio alone, the newest stick or none.

The robot stops by itself when no stick comes (``onboard/flight/drive.py``); what is here may fail
in any way without its swimming on. Who drives is kept in memory alone: a station that was started
anew drives nobody.
"""
