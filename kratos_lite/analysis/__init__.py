"""Analyses: statics, transients, natural frequencies, steady motion; and the one loop through time."""
