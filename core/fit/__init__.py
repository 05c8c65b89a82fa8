"""Data with their covariance, predictions, bounded Gauss-Newton and what it leaves uncertain."""
