"""What a report shows of a result besides its figures: shapes, receptances, changed elements."""
