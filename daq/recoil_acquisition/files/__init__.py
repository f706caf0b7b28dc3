"""Files and their names: new ones whole or not at all, regular ones alone, strict JSON and bounded TOML, locks."""
