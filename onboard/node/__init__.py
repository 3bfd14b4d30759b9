"""The robot's devices as nodes: programs that each own one device and serve it over a socket.

Thesis section 2.1.2: every sensor, actuator and radio has a node with a socket that several
programs may use at once; programs for higher tasks know the node, not the device behind it.
"""
