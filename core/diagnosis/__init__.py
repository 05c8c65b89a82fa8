"""Verdict, proof on unseen data, and words."""
