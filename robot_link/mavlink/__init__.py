"""MAVLink 2 with the grace dialect: codec and services."""
