"""What a station is to who starts, watches and replaces its process."""
