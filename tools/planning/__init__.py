"""Which table positions to measure at, with what weights, and the proof that nothing better exists."""
