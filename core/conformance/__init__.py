"""The conformance kit: what a plugin must keep, checked piece by piece on small structures."""

SECONDS = 60.0  # that one trial may take
