"""Kratos model files, `.mdpa`: `reader` and `writer`."""
