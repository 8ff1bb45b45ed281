"""Only compiled kernels go without types: mypy lets functions pass that have none at all."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[1]
SOURCES = [*ROOT.glob("ikgym/**/*.py"), *ROOT.glob("baselines/**/*.py"), *ROOT.glob("benchmarks/**/*.py")]
KERNELS = {"kernel", "inner", "uncounted", "inlined", "expanded", "njit"}


def untyped(source: str) -> list[str]:
    """The functions without any annotation that are no kernels, and not within one."""
    out = []

    def visit(node: ast.AST) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef)):
                if KERNELS & {d.id for d in map(_called, child.decorator_list) if isinstance(d, ast.Name)}:
                    continue
                if child.returns is None:
                    out.append(child.name)
            visit(child)

    visit(ast.parse(source))
    return out


def _called(decorator: ast.expr) -> ast.expr:
    return decorator.func if isinstance(decorator, ast.Call) else decorator


def test_all_but_kernels_have_types():
    found = {str(path.relative_to(ROOT)): untyped(path.read_text(encoding="utf-8")) for path in SOURCES}
    assert len(found) > 300
    assert {path: names for path, names in found.items() if names} == {}


def test_what_is_found():
    assert untyped("def f(x): pass") == ["f"]
    assert untyped("@kernel\ndef f(x):\n    return x") == []
    assert untyped("class A:\n    def f(self): pass") == ["f"]
    assert untyped("def f(x: int) -> int: return x") == []
