"""Learned controllers: an environment of Gymnasium over any scenario, and policies as controllers of the navigation.

The environment needs the extra ``gym``; a policy drives without it. What a policy observes is computed by one class in
both, so that it sees the same in training and in an evaluation.
"""
