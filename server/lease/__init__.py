"""Pilot in charge: a lease per robot, held by one person or script, and the hold on automation.

Only who holds a robot's lease sends it plans, settings and orders. To surface it is never a matter
of a lease. A lease does not expire into nobody's hands: a silent holder keeps it until somebody
else wants it.
"""
