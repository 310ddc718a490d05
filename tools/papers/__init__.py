"""Published tables beside what is computed here: calibration, attitude algorithms, word length."""
