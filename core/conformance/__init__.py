"""The conformance kit: what a plugin must keep, checked piece by piece on small structures."""
