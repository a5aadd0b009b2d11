"""The experiment of the Move Base Flex paper (its Table I), repeated: ``mbf bench table1``.

``environments`` holds the warehouse and the outdoor world, ``conditions`` the executives that are compared.
``counting`` reads what happened from the event log, ``repetition`` is one run, ``campaign`` all of them.
``acceptance_checks``, ``statistics`` and ``verdict`` judge; ``report`` and ``picture`` show.
"""
