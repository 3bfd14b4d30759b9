"""What travels by satellite, both ways: missions in chunks, orders, and the robot's records.

Pure functions and frozen values without input or output; layouts in ``frame``, ``chunk``, ``order``
and ``record``. Both ends use the same code.
"""
