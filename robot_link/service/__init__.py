"""MAVLink services of both ends, one a file: parameters, files, missions, clock, streams, keys."""
