"""The operator's page without ROS: what it shows, how it is sent, who may act; and recorded runs.

`server` serves what a `Source` has: the node `operator_page` live, or `recorded_run`.
"""
