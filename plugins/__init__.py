"""The built-in plugins, on the same entry points as anyone's."""
