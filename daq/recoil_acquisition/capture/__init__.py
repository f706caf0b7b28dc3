"""Armed acquisition: live sources into the journal, past the trigger, and out as one shot's captures."""
