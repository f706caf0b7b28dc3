"""The report of one shot: figures as plain arrays, and the page that shows them without a network."""
