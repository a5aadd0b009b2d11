"""The live view: a page on which a run can be watched and controlled in progress; needs the extra ``sim``.

The threads of the page only put commands into a queue (``controls``). The simulator's thread empties it between two
steps, when no other thread of the run works, and draws if there are visitors (``session``).
"""
