"""The harness: jobs, isolation, store, scoring, statistics."""
