"""The hidden-effect suite: many benches with secrets, measured in time, and what the diagnosis makes of the records."""
