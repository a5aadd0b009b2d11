"""The live view: a page on which a run can be watched and controlled while it goes on; needs the extra ``sim``.

The page's threads only ever put commands into a queue (``commands``). The simulator's thread empties it between two
steps, when no other thread of the run works, and draws if there are visitors (``session``).
"""
