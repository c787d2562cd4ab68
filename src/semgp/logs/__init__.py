"""Robot logs: bags of ROS 1 and ROS 2 in and out, and a ROS 2 node. The extra `ros` brings rosbags.

>>> from semgp import open_scans
>>> scans = open_scans("run.mcap", topic="/points", frame="map")  # doctest: +SKIP
>>> from semgp.logs.recording import write_clouds
>>> write_clouds("copy.bag", scans)  # doctest: +SKIP
>>> from semgp.logs.maps import write_map
>>> write_map("map.mcap", semantic_map)  # doctest: +SKIP
"""
