"""What is odd about a model and its measurement before any fit."""
