"""Readable versions of the compiled kernels, against which tests hold these."""
