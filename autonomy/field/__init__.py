"""Maps of unknown scalar fields by Gaussian processes."""
