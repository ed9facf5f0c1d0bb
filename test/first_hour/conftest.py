"""The live part has a graph as the tests of the graph do."""

from test.graph.conftest import graph as graph
