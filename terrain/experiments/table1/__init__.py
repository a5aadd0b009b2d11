"""The experiment of the Move Base Flex paper (its Table I), made again: ``mbf bench table1``.

``world`` and ``traffic`` make the warehouse, ``stage`` runs one simulated robot in it, ``arms`` are the executives that
are compared, ``counting`` reads what happened from the event log, ``repetition`` is one run, ``campaign`` all of them.
``gates``, ``statistics`` and ``verdict`` judge; ``report`` and ``picture`` show. Nothing else imports this package.
"""
