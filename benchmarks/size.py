"""How large each part is that has a budget: lines of code, and all lines.

    python benchmarks/size.py

Code is what is neither docstring, comment nor empty; of JavaScript what is not empty.
"""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / 'lathe_chatter'
PARTS = {
    'machine files: the loader': (350, ('model/machine_file.py', 'model/values_with_units.py')),
    'machine files: identification': (500, ('tap_test/*.py',)),
    'machine files: probability': (250, ('model/uncertainty.py', 'stability/probability.py')),
    'page: Python': (700, ('page/*.py', 'nodes/operator_*.py')),
    'page: JavaScript': (600, ('page/static/*.js',)),
    'executors': (200, ('executors.py',)),
    'data sets': (500, ('dataset/*.py',)),
    'environment': (100, ('gym_environment.py',)),
    'supervisor': (350, ('supervisor/*.py', 'nodes/supervisor_node.py')),
    'the package: Python': (17_500, ('**/*.py',)),
}


def code_lines(file: Path) -> int:
    """How many lines of a module are neither docstring, comment nor empty."""
    text = file.read_text(encoding='utf-8')
    said: set[int] = set()
    if file.suffix == '.py':
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
                said |= {*range(node.lineno, (node.end_lineno or 0) + 1)}
    lines = enumerate(text.splitlines(), 1)
    return sum(bool(line.split('#')[0].strip()) and number not in said for number, line in lines)


def main() -> None:
    """Count."""
    print(f'{"":32} {"code":>7} {"all":>7} {"goal":>7}')
    for what, (goal, patterns) in PARTS.items():
        files = [file for pattern in patterns for file in sorted(PACKAGE.glob(pattern))]
        files = [file for file in files if not file.name.endswith('.min.js')]
        whole = sum(len(file.read_text(encoding='utf-8').splitlines()) for file in files)
        print(f'{what:32} {sum(map(code_lines, files)):7} {whole:7} {goal:7}')


if __name__ == '__main__':
    main()
