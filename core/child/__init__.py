"""Processes apart: the fork server, their limits, namespaces and filter of system calls."""
