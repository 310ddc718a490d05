"""The blocks of accelerometers and of gyros, and their inverses, which take out what a calibration has found."""
