"""How a model may change: places, matrices, parameters; of strategies, groups and effects."""
