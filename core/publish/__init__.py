"""A public leaderboard from result files."""
