"""Head, tables, sentences and terms of a document, as page and paper both show them, in the units that were chosen."""
