"""One firing, assembled from recordings, and what its verdict is made of."""
