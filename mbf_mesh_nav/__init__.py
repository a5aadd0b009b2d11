"""Navigation on triangle meshes: server, map, layers, planners, controllers and recoveries."""
