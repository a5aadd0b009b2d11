"""The main run of Table I, ``mbf bench table1-main``: four conditions in three buildings on seeds nobody tuned for.

``buildings`` holds the worlds, ``floor_plans`` the family that is drawn, ``conditions`` the executives and
``navigation.yaml`` what all of them share. ``trial`` is one run and its row, ``run`` does those that are missing,
``table`` judges the rows, and ``picture`` draws how the result settles. The record of seeds 0 to 9 stays in the folder
above, with its conditions and its criteria.
"""
