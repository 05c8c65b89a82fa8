"""Structures, defects and data faults whose truth is known, made outside of femubench."""
