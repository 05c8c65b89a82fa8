"""Modes from measured responses: poles, their selection, the fit with its standard deviations."""
