"""Names have one meaning in the whole project."""

import ast
from collections import defaultdict

from .source import PACKAGES, relative, sources, tree


def test_no_public_class_has_the_name_of_another():
    places = defaultdict(list)
    for path in sources(*PACKAGES):
        for node in ast.walk(tree(path)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(relative(path))
    assert len(places) > 100
    assert {name: files for name, files in places.items() if len(files) > 1} == {}
