"""How paths of planners that know a disc only are made to fit the robot's outline: misfits, runs at ends, passages."""
