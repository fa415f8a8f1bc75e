"""Bodies that move: rigid, pseudo-rigid and finite-element ones, after Solfec-1.0."""
