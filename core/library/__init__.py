"""What `femubench` gives to a user: all that the command line does, as functions."""
