"""The paper copy, typeset: PDF, and figures as pictures."""
