"""Truth from outside: structures as solids, their modes, and the beam model an engineer draws of them.

Nothing here is installed with femubench. The side of the solids imports nothing of it either.
"""
