"""The certificate that is signed: made of a report or a campaign's answer, signed, and checked as a whole."""
