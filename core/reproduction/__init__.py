"""Published tables, cell by cell, next to what a careful re-run gives."""
