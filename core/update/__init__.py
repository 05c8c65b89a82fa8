"""Steps that several updating strategies share."""
