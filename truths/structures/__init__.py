"""One file a structure; each holds its description as `STRUCTURE`."""
