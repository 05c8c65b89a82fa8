"""Truth from outside: solids of structures, their modes, the beam model an engineer draws.

Nothing here is installed with femubench. The side of the solids imports nothing of it either.
"""
