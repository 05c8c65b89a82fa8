"""Jobs, their isolation and limits, the judge and the store."""
