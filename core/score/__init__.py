"""How good a model is: blocks of errors, ranking, statistics."""
