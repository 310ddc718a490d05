"""What gyros and accelerometers say in motion: sampling, rests, calibration by gravity's norm, attitudes carried on."""
