"""Cases of the benches, drawn at run time from stated distributions."""
