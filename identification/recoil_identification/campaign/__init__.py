"""Many shots of one rig as one answer: what they share is estimated once, and what changed among them is named."""
