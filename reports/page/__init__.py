"""A run as one HTML document that needs nothing but itself: its data, statistics and assets."""
