"""Text tables: files, cells, blocks of numbers, their time bases, and the recorders' exports made of them."""
