"""The fixed state machine of ``move_base``, for comparisons."""
