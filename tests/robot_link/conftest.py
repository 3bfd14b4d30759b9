"""Property tests here may run on a busy machine: their examples have no deadline."""

from hypothesis import settings

settings.register_profile("robot_link", deadline=None)
settings.load_profile("robot_link")
