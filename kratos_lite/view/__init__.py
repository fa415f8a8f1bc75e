"""Figures: bodies deformed and colored, along their paths; reference cells; errors of adaptive solutions."""
