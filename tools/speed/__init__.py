"""The speed table: measured and stored row by row, drawn, and compared between commits."""
