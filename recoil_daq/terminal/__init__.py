"""How documents and results look in a terminal: lines, aligned tables, colours, and the streams they go to."""
