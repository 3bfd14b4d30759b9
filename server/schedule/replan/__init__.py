"""Replanning in contact: how long a robot is in contact, and whether a new plan is worth sending.

A suggestion is a draft with its gain against what is left of the plan that is flown. It is sent by
a person, or by itself where the settings of the robot say so, within the limit of an hour.
"""
