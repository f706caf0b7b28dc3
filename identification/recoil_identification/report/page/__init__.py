"""The page in a browser, which needs no network: its HTML, styles and scripts."""
