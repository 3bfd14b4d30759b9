"""Faults that an operator of the demo causes in robots that do not exist.

Asks the simulator by its wire (``simulator.fault_desk``), and marks in the live feed what it says.
"""
