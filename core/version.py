"""The version of femubench, which stands here alone."""

__version__ = "0.2.0"
