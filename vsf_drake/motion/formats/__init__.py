"""Files of gait laboratories: C3D, TRC, MOT, STO, CSV and Cortex forces, read into one
`Recording`."""
