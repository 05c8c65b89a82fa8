"""Twins of a case: the same physics in other sizes and under other names."""
