"""How the station itself is: metrics, logs, its clock, its health."""
