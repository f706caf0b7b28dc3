"""Documents that a machine reads: report and campaign as JSON, their tables, each number explained and made again."""
