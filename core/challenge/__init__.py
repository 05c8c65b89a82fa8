"""Blind cases: a structure with a hidden fault, its sealed truth, and a judge of answers."""
