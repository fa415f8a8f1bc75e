"""Decks of CalculiX and Abaqus (`.inp`): cards, the mesh and model that they describe, and their steps."""
