"""Recovery behaviours that are a matter of the mesh; the others stand in ``mbf_abstract.maps.recoveries``."""
