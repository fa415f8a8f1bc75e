"""Scenes: a body, what acts on it, and how it is to be marched, as JSON or as a Python script."""
