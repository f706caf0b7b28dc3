"""The pages of a folder on another screen or a phone: read-only, to those who may, and nothing beside them."""
