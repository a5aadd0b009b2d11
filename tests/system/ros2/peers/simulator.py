"""A simulated robot as ``mbf run SCENARIO --ros2`` makes it."""

import sys

from mbf_abstract.cli import main

sys.argv = ["mbf", "run", *sys.argv[1:]]
main()
