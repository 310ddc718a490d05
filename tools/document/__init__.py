"""What a result says, as blocks, rendered as text, page or notebook. It knows no record and no instrument."""
