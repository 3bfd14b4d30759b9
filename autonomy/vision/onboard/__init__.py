"""The camera that a robot carries itself: how it is told, where it says the robot is, its mount."""
