"""The built-in plugins: one file each, on the same entry points as anyone's."""
