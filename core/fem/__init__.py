"""Beam finite elements: sections, element matrices, meshing, assembly, parameters."""
