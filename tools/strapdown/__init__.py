"""The diagnosis of records of gyros and accelerometers without a table."""
