"""Numbers of the control laws, by which compiled code chooses; free of compiled code itself."""

BACKSTEPPING, PID, INTEGRAL, GOVERNOR, SWIMMING = range(5)
