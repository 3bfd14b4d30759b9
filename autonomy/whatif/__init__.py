"""What-if runs: a vehicle, a reference, a disturbance and controllers, on the same seeds."""
