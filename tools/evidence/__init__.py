"""What a record says against a model, in one form whatever the record, and its makers."""
