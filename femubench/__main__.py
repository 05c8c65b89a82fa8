"""``python -m femubench``: the command ``bench`` of a clone that is not installed."""

from femubench.core.cli.main import bench

bench()
