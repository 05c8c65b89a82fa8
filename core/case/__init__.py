"""Case folders: their schema, how they are read, and what comes of them."""
