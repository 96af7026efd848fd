"""Files of gait laboratories: C3D, TRC, MOT, STO, CSV and Cortex forces, read into one
`Recording`."""

MARKER_FILES = (".c3d", ".trc")
