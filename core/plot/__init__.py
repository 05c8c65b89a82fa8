"""Drawings with matplotlib, which is imported where something is drawn."""
