"""A finer and different simulator of the prosthesis, whose output stands in for measurements.

It shares the published geometry with `vsf_drake` and nothing else: not the keel's discretisation,
not the laws of foam, friction and socket, not the time stepping. What it gives is synthetic.
"""
