"""Two-dimensional layered costmaps and the planners, controllers and recoveries that drive on them."""
