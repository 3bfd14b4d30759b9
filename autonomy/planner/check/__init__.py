"""Whether a plan keeps to the site, the water, the energy and the uncertainty allowed."""
