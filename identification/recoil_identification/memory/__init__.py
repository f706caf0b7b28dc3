"""Limited-memory least squares: the estimate of a sliding window, at every sample."""
