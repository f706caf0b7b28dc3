"""Universal Files: time responses of datasets 58 and 58b."""
