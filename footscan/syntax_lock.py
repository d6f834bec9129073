"""A lock for whoever builds syntax trees.

Python 3.11 counts the depth of the tree that it builds once for all threads. If another thread builds one meanwhile, it
raises "SystemError: AST constructor recursion depth mismatch". `numpy.load` builds one for the header of each array.
"""

from threading import Lock

SYNTAX_LOCK = Lock()
