"""What a trajectory would learn of the field, by factors of its covariance."""
