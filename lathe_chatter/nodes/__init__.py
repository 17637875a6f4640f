"""The ROS 2 nodes: they declare, validate, call the core and publish; no physics lives here."""
