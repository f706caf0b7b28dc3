"""Page of a day at the range, and one archive of all that it made."""
