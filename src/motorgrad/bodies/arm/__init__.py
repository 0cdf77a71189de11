"""An arm that lifts loads, and the table of how high it lifts them."""
