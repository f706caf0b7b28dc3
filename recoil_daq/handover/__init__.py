"""What a day at the range hands over: its page, and one archive of all that it made."""
