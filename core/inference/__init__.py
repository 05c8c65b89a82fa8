"""Data, noise, prior, fit, evidence and search of explanations."""
