"""Armed acquisition: live sources into the log, past the trigger, and out as one shot's capture."""
