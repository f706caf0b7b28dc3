"""Results in a row: an index of shots, a history of campaigns, a sweep of one option, reports beside one another."""
