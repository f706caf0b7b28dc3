"""The report of a shot or campaign: what is drawn and what is written, and page and paper that show both alike."""
