"""Plugins: hook specifications, the loader, and the roles that plugins fill."""
