"""What is drawn, in plain data: the structure, places on it, and what a model predicts."""
