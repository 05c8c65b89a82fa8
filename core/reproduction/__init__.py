"""Published tables, cell by cell, beside what a careful re-run gives."""
