"""Native FMUs: kernels as C99 behind one C implementation of FMI 2.0 and FMI 3.0 co-simulation."""
