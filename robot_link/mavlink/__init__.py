"""MAVLink 2 with the project's own dialect: build step, framing, values, mission transfer."""
