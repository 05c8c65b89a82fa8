"""Modal analysis: eigenpairs, rigid-body modes, correlation, pairing, expansion, sensitivities."""
