"""The program that flies on the robot: estimator, controller, mission executive."""
